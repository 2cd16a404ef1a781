#include "lod/build/measure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/math.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

// Points of the source that a cluster carries; half of them are the farthest. A cluster of a coarse
// level stands for more of the source, and there are fewer of them.
constexpr size_t kCarried = 16, kMostCarried = 512;
// Distances change by no more than the way between samples does, and are larger than at the
// samples by less than this nearly everywhere.
constexpr float kMargin = 1.5f;
// Only what is farther than this part of the farthest yet, squared, has to be known better.
constexpr float kKnownWell = 0.5f;

// Points of a group that are looked up beside one for each triangle: large triangles have more.
constexpr size_t kPointsByArea = 2048;
constexpr uint32_t kMostInTriangle = 256;

using Corners = std::array<Vec3, 3>;

// The middle of its longest side, where a triangle is farthest from its corners.
Vec3 middle_of(const Corners& p) {
  size_t longest = 0;
  float most = -1.0f;
  for (size_t i = 0; i < 3; ++i) {
    const Vec3 side = p[(i + 1) % 3] - p[i];
    if (dot(side, side) > most) most = dot(side, side), longest = i;
  }
  return (p[longest] + p[(longest + 1) % 3]) * 0.5f;
}

float area_of(const Corners& p) {
  const Vec3 normal = cross(p[1] - p[0], p[2] - p[0]);
  return std::sqrt(dot(normal, normal));
}

// The i-th of points that fill a triangle evenly (Roberts' sequence, folded).
Vec3 point_in(const Corners& p, uint32_t i) {
  const float u = std::fmod(0.5f + 0.7548777f * i, 1.0f),
              v = std::fmod(0.5f + 0.5698403f * i, 1.0f);
  const bool over = u + v > 1.0f;
  return p[0] + (p[1] - p[0]) * (over ? 1 - u : u) + (p[2] - p[0]) * (over ? 1 - v : v);
}

}  // namespace

SurfaceDistance::SurfaceDistance(const Source& source, const ClusterSet& clusters)
    : source_(source), first_new_(source.mesh.positions.size()) {
  surface_.build(clusters, source.mesh.positions, source.scale, true);
}

void SurfaceDistance::add_vertices(const ClusterSet& set, std::span<const uint32_t> clusters,
                                   std::vector<Vec3>& samples) const {
  std::vector<uint32_t> vertices;
  for (uint32_t c : clusters)
    for (uint32_t v : set.cluster_vertices(c)) {
      const uint32_t id = source_.has_wedges ? source_.position_ids[v] : v;
      if (id < first_new_) vertices.push_back(id);
    }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  for (uint32_t v : vertices) samples.push_back(position(v));
}

Measured SurfaceDistance::measure(const ClusterSet& made, std::span<const Vec3> samples,
                                  uint32_t level) const {
  Measured result;
  if (made.triangle_count() == 0) return result;
  result.valid = true;
  struct Found {
    float squared;
    uint32_t cluster, sample;
  };
  std::vector<Found> found;
  found.reserve(samples.size());
  TriangleDistanceTree& surface = made_.local();
  surface.build(made, source_.mesh.positions, source_.scale);
  float farthest = 0;
  uint32_t hint = 0;
  for (uint32_t i = 0; i < samples.size(); ++i) {
    const TriangleDistanceTree::Nearest at =
        surface.nearest(samples[i], kKnownWell * farthest, hint);
    found.push_back({at.squared, at.cluster, i});
    farthest = std::max(farthest, at.squared);
    hint = at.block;
  }

  std::vector<Corners> triangles;
  triangles.reserve(made.triangle_count());
  double area = 0;
  for (size_t c = 0; c < made.size(); ++c) {
    const auto vertices = made.cluster_vertices(c);
    const auto corners = made.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3) {
      triangles.push_back({position(vertices[corners[i]]), position(vertices[corners[i + 1]]),
                           position(vertices[corners[i + 2]])});
      area += area_of(triangles.back());
    }
  }
  hint = kNone;
  const auto look_up = [&](const Vec3& point) {
    const TriangleDistanceTree::Nearest at = surface_.nearest(point, farthest, hint);
    farthest = std::max(farthest, at.squared);
    hint = at.block;
  };
  for (const Corners& p : triangles) {
    look_up(middle_of(p));
    const double points = area > 0 ? kPointsByArea * (area_of(p) / area) : 0;
    const uint32_t count =
        points < kMostInTriangle ? static_cast<uint32_t>(points) : kMostInTriangle;
    for (uint32_t i = 0; i < count; ++i) look_up(point_in(p, i));
  }
  farthest = std::sqrt(farthest);
  result.distance = farthest / source_.scale;
  result.bound = kMargin * result.distance;

  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    if (a.cluster != b.cluster) return a.cluster < b.cluster;
    return a.squared != b.squared ? a.squared > b.squared : a.sample < b.sample;
  });
  const size_t carried = std::min(kCarried << std::min(2 * level / 3, 8u), kMostCarried);
  result.samples.resize(made.size());
  for (size_t begin = 0; begin < found.size();) {
    size_t end = begin;
    while (end < found.size() && found[end].cluster == found[begin].cluster) ++end;
    const size_t worst = std::min(end - begin, carried / 2), rest = end - begin - worst;
    auto& kept = result.samples[found[begin].cluster];
    for (size_t i = begin; i < begin + worst; ++i) kept.push_back(samples[found[i].sample]);
    const size_t others = std::min(rest, carried - worst);
    for (size_t i = 0; i < others; ++i)
      kept.push_back(samples[found[begin + worst + i * rest / others].sample]);
    begin = end;
  }
  return result;
}

}  // namespace umbel::lod
