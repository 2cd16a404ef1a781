// Leaves, grass, rubble: many small parts that hang together with nothing. Simplified one by one
// they shrink and vanish, and what they cover with them. Those that are left are enlarged about
// their middles until all cover as much area as before (Cook, Halstead, Planck & Ryu, "Stochastic
// Simplification of Aggregate Detail", 2007).
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/math.hpp"
#include "lod/simplify/simplify.hpp"

namespace umbel::lod {
namespace {

// Only where a group keeps less than this of its area, for want of what small parts had, and only
// parts of at most this part of its radius.
constexpr double kKept = 0.9, kSmallPart = 0.4;
constexpr size_t kFewestParts = 8;
// By how much a part grows in one step at most and, to be worth it, at least.
constexpr double kMostGrowth = 1.6, kLeastGrowth = 1.02;

double area_of(const Vec3& a, const Vec3& b, const Vec3& c) {
  return 0.5 * double{length(cross(b - a, c - a))};
}

}  // namespace

// Areas of parts before and after; nothing where the group is not of that kind.
std::vector<double> GroupSimplifier::growths(std::span<const Triangle> left) {
  const auto area = [&](const Triangle& t) {
    return area_of(positions_[t[0]], positions_[t[1]], positions_[t[2]]);
  };
  const double before = collapser_.area();
  double after = 0;
  for (const Triangle& t : left) after += area(t);
  if (!(after < kKept * before)) return {};
  if (!has_parts_) find_components();
  if (parts_.size() < kFewestParts) return {};
  Aabb all;
  for (const Part& part : parts_) extend(all, part.box);
  const double most = kSmallPart * 0.5 * double{length(all.max - all.min)};
  std::vector<double> had(parts_.size(), 0), has(parts_.size(), 0);
  for (const Triangle& t : triangles_) had[component_of_[position_of_[t[0]]]] += area(t);
  for (const Triangle& t : left) has[component_of_[position_of_[t[0]]]] += area(t);
  double gone = 0, kept = 0, lost = 0;
  size_t small = 0;
  for (size_t i = 0; i < parts_.size(); ++i) {
    if (parts_[i].fixed || double{parts_[i].radius()} > most) {
      had[i] = has[i] = 0;
      continue;
    }
    ++small;
    (has[i] > 0 ? kept : gone) += had[i];
    lost += had[i] - has[i];
  }
  if (small < kFewestParts || !(lost > (1 - kKept) * before) || !(kept > 0)) return {};
  std::vector<double> growth(parts_.size(), 1);
  for (size_t i = 0; i < parts_.size(); ++i)
    if (has[i] > 0)
      growth[i] = std::clamp(std::sqrt(had[i] / has[i] * (1 + gone / kept)), 1.0, kMostGrowth);
  return growth;
}

// Moves what is left of small parts away from their middles.
void GroupSimplifier::keep_area(const Candidate& best, Simplified& result) {
  const std::vector<double> growth = growths(best.triangles);
  if (growth.empty()) return;
  std::vector<double> weights(parts_.size(), 0);
  std::vector<std::array<double, 3>> middles(parts_.size(), {0, 0, 0});
  for (const Triangle& t : triangles_) {
    const uint32_t part = component_of_[position_of_[t[0]]];
    const Vec3 &a = positions_[t[0]], &b = positions_[t[1]], &c = positions_[t[2]];
    const double area = area_of(a, b, c);
    weights[part] += area;
    middles[part][0] += area * (double{a.x} + b.x + c.x) / 3;
    middles[part][1] += area * (double{a.y} + b.y + c.y) / 3;
    middles[part][2] += area * (double{a.z} + b.z + c.z) / 3;
  }
  std::vector<Triangle> grown;                               // of positions
  std::vector<Vec3> moved(position_ids_.size());             // unscaled
  std::vector<uint32_t> place(position_ids_.size(), kNone);  // the first new vertex there
  for (const Triangle& t : best.triangles) {
    const uint32_t part = component_of_[position_of_[t[0]]];
    if (!(growth[part] >= kLeastGrowth)) continue;
    const std::array<double, 3>& sum = middles[part];
    const auto mean = [&](size_t axis) { return static_cast<float>(sum[axis] / weights[part]); };
    const Vec3 middle{mean(0), mean(1), mean(2)};
    grown.push_back({position_of_[t[0]], position_of_[t[1]], position_of_[t[2]]});
    for (uint32_t v : t) {
      Vec3& to = moved[position_of_[v]];
      to = (middle + (positions_[v] - middle) * static_cast<float>(growth[part])) *
           (1.0f / source_.scale);
      if (config_.position_step > 0) snap_to_grid(std::span(&to, 1), config_.position_step);
    }
    // Where parts are as small as the steps between floats.
    const Vec3 &a = moved[grown.back()[0]], &b = moved[grown.back()[1]],
               &c = moved[grown.back()[2]];
    if (a == b || b == c || c == a) return;
  }
  if (grown.empty()) return;
  std::vector<uint8_t> has_moved(vertices_.size(), 0);
  float farthest = 0;
  for (const Triangle& t : best.triangles) {
    if (!(growth[component_of_[position_of_[t[0]]]] >= kLeastGrowth)) continue;
    for (const uint32_t v : t) {
      if (std::exchange(has_moved[v], 1)) continue;
      const uint32_t p = position_of_[v];
      add_moved(v, moved[p], place[p], result);
      farthest = std::max(farthest, length(moved[p] - positions_[v] * (1.0f / source_.scale)));
    }
  }
  result.error += farthest;
  result.method = SimplifyMethod::kSloppy;
  result.limiting_factor = LimitingFactor::kAreaLost;
  std::vector<uint32_t> numbers(position_ids_.size());
  std::iota(numbers.begin(), numbers.end(), 0u);
  const std::vector<uint32_t> components = non_manifold_components(grown, numbers);
  result.added.components.resize(result.added.position_ids.size(), kNone);
  for (uint32_t p = 0; p < place.size(); ++p)
    if (place[p] != kNone && components[p] != kNone)
      result.added.components[place[p] - kAddedVertex] = place[components[p]];
}

// A vertex at a new position instead of the local one.
void GroupSimplifier::add_moved(uint32_t local, const Vec3& position, uint32_t& first_there,
                                Simplified& result) {
  AddedVertices& added = result.added;
  const uint32_t current = left_.vertices[local];
  Mesh one;
  if (current < kAddedVertex)
    append_vertex(one, source_.mesh, current);
  else
    append_vertex(one, added.mesh, current - kAddedVertex);
  one.positions[0] = position;
  append_vertex(added.mesh, one, 0);
  const uint32_t number = kAddedVertex + static_cast<uint32_t>(added.position_ids.size());
  added.position_ids.push_back(first_there);
  if (first_there == kNone) first_there = number;
  added.materials.push_back(material(local));
  left_.vertices[local] = number;
  left_.positions[local] = position;
}

}  // namespace umbel::lod
