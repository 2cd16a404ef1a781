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

  hint = kNone;
  for (size_t c = 0; c < made.size(); ++c) {
    const auto vertices = made.cluster_vertices(c);
    const auto corners = made.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3) {
      const Vec3 middle =
          middle_of({position(vertices[corners[i]]), position(vertices[corners[i + 1]]),
                     position(vertices[corners[i + 2]])});
      const TriangleDistanceTree::Nearest at = surface_.nearest(middle, farthest, hint);
      farthest = std::max(farthest, at.squared);
      hint = at.block;
    }
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
