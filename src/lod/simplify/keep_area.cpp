#include "lod/simplify/keep_area.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "base/math.hpp"
#include "lod/simplify/move_vertices.hpp"

namespace umbel::lod {
namespace {

// Only where a group keeps less than this of its area, because small components lost theirs, and
// only components of at most this part of its radius.
constexpr double kKeptArea = 0.9, kSmall = 0.4;
constexpr size_t kFewest = 8;
// By how much a component grows in one step at most and, to be worth it, at least.
constexpr double kMostGrowth = 1.6, kLeastGrowth = 1.02;

double area_of(const Vec3& a, const Vec3& b, const Vec3& c) {
  return 0.5 * double{length(cross(b - a, c - a))};
}

double area_of(const GroupMesh& group, const Triangle& t) {
  return area_of(group.positions[t[0]], group.positions[t[1]], group.positions[t[2]]);
}

// The factors by which components grow; nothing where the group has no such components.
std::vector<double> growths(const GroupMesh& group, GroupComponents& components, double area_before,
                            std::span<const Triangle> left) {
  double area_after = 0;
  for (const Triangle& t : left) area_after += area_of(group, t);
  if (!(area_after < kKeptArea * area_before)) return {};
  components.find();
  const auto all = components.all();
  if (all.size() < kFewest) return {};
  Aabb box;
  for (const auto& component : all) extend(box, component.box);
  const double most = kSmall * 0.5 * double{length(box.max - box.min)};
  std::vector<double> had(all.size(), 0), has(all.size(), 0);
  for (const Triangle& t : group.triangles) had[components.of(t)] += area_of(group, t);
  for (const Triangle& t : left) has[components.of(t)] += area_of(group, t);
  double gone = 0, kept = 0, lost = 0;
  size_t small = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    if (all[i].fixed || double{all[i].radius()} > most) {
      had[i] = has[i] = 0;
      continue;
    }
    ++small;
    (has[i] > 0 ? kept : gone) += had[i];
    lost += had[i] - has[i];
  }
  if (small < kFewest || !(lost > (1 - kKeptArea) * area_before) || !(kept > 0)) return {};
  std::vector<double> growth(all.size(), 1);
  for (size_t i = 0; i < all.size(); ++i)
    if (has[i] > 0)
      growth[i] = std::clamp(std::sqrt(had[i] / has[i] * (1 + gone / kept)), 1.0, kMostGrowth);
  return growth;
}

// Of components, by area.
std::vector<Vec3> centroids_of(const GroupMesh& group, const GroupComponents& components) {
  const size_t count = components.all().size();
  std::vector<double> weights(count, 0);
  std::vector<std::array<double, 3>> sums(count, {0, 0, 0});
  for (const Triangle& t : group.triangles) {
    const uint32_t component = components.of(t);
    const Vec3 &a = group.positions[t[0]], &b = group.positions[t[1]], &c = group.positions[t[2]];
    const double area = area_of(a, b, c);
    weights[component] += area;
    sums[component][0] += area * (double{a.x} + b.x + c.x) / 3;
    sums[component][1] += area * (double{a.y} + b.y + c.y) / 3;
    sums[component][2] += area * (double{a.z} + b.z + c.z) / 3;
  }
  std::vector<Vec3> centroids(count);
  for (size_t i = 0; i < count; ++i) {
    const auto mean = [&](size_t axis) { return static_cast<float>(sums[i][axis] / weights[i]); };
    centroids[i] = {mean(0), mean(1), mean(2)};
  }
  return centroids;
}

// To one of the nearest positions that may be used, in steps of the largest coordinate's
// precision. Whether there is one.
bool move_to_unused(const UnusedPositions& unused, Vec3& position) {
  constexpr int kFarthest = 12;
  if (unused.contains(position)) return true;
  const float largest =
      std::max({std::fabs(position.x), std::fabs(position.y), std::fabs(position.z)});
  if (!(largest < 0.5f * std::numeric_limits<float>::max())) return false;
  const float step = largest - std::nextafter(largest, 0.0f);
  for (int reach = 1; reach <= kFarthest; ++reach)
    for (int i = -reach; i <= reach; ++i)
      for (int j = -reach; j <= reach; ++j) {
        // Of the inside of the cube only its faces are new.
        const bool is_face = std::abs(i) == reach || std::abs(j) == reach;
        for (int k = -reach; k <= reach; k += is_face ? 1 : 2 * reach) {
          const Vec3 offset{static_cast<float>(i), static_cast<float>(j), static_cast<float>(k)};
          const Vec3 near = position + offset * step;
          if (!unused.contains(near)) continue;
          position = near;
          return true;
        }
      }
  return false;
}

}  // namespace

bool loses_area(const GroupMesh& group, GroupComponents& components, double area_before,
                const Simplified& result) {
  return !growths(group, components, area_before, result.mesh.triangles).empty();
}

void keep_area(const GroupMesh& group, GroupComponents& components, double area_before,
               const UnusedPositions* unused, Simplified& result) {
  const std::vector<Triangle>& left = result.mesh.triangles;
  std::vector<double> growth = growths(group, components, area_before, left);
  if (growth.empty()) return;
  const std::vector<Vec3> centroids = centroids_of(group, components);
  const float unscale = 1.0f / group.source.scale, step = group.config.position_step;
  std::vector<Vec3> moved(group.position_count());  // unscaled
  std::vector<uint8_t> has_moved(group.position_count(), 0);
  for (const Triangle& t : left) {
    const uint32_t component = components.of(t);
    if (!(growth[component] >= kLeastGrowth)) continue;
    const Vec3& centroid = centroids[component];
    for (uint32_t v : t) {
      if (std::exchange(has_moved[group.position_of[v]], 1)) continue;
      Vec3& to = moved[group.position_of[v]];
      to = (centroid + (group.positions[v] - centroid) * static_cast<float>(growth[component])) *
           unscale;
      if (step > 0) snap_to_grid(std::span(&to, 1), step);
      if (unused && !move_to_unused(*unused, to)) growth[component] = 1;
    }
  }
  std::vector<Triangle> enlarged;  // of the group's vertices
  for (const Triangle& t : left) {
    if (!(growth[components.of(t)] >= kLeastGrowth)) continue;
    enlarged.push_back(t);
    // Components may be as small as the steps between floats.
    const auto [a, b, c] = group.positions_of(t);
    if (moved[a] == moved[b] || moved[b] == moved[c] || moved[c] == moved[a]) return;
  }
  if (unused) result.limiting_factor = LimitingFactor::kAreaLost;
  if (enlarged.empty()) return;
  result.error += move_vertices(group, enlarged, moved, result);
  result.method = SimplifyMethod::kSloppy;
  result.limiting_factor = LimitingFactor::kAreaLost;
}

}  // namespace umbel::lod
