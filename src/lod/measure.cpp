#include "lod/measure.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "umbel/bvh_presets.hpp"

namespace umbel::lod {
namespace {

// Points of the source that a cluster carries; half of them are the farthest. A cluster of a coarse
// level stands for more of the source, and there are fewer of them.
constexpr size_t kCarried = 32, kMostCarried = 512;
// Triangles of a simplified group that are sampled; a quarter of them are the largest.
constexpr size_t kSampled = 512;
// Distances change by no more than the way between samples does, and are larger than at the
// samples by less than this nearly everywhere.
constexpr float kMargin = 1.25f;

struct Soup {
  std::vector<Vec3> positions;  // three a triangle
  std::vector<Triangle> triangles;

  explicit Soup(size_t count) {
    positions.reserve(3 * count);
    for (uint32_t i = 0; i < count; ++i) triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  float double_area(size_t t) const {
    const Vec3* p = &positions[3 * t];
    return length(cross(p[1] - p[0], p[2] - p[0]));
  }
  TriangleBvh bvh() const {
    TriangleBvhConfig config;
    config.tree = bvh::builder_preset("lbvh");
    MeshView view;
    view.positions = positions;
    view.triangles = triangles;
    return TriangleBvh::build(view, config);
  }
};

template <typename Position>
Soup soup_of(const ClusterSet& set, const Position& position) {
  Soup soup(set.triangle_count());
  for (size_t c = 0; c < set.size(); ++c) {
    const auto vertices = set.cluster_vertices(c);
    for (uint8_t corner : set.cluster_corners(c))
      soup.positions.push_back(position(vertices[corner]));
  }
  return soup;
}

// The largest triangles, and others at even steps.
std::vector<uint32_t> triangles_to_sample(const Soup& soup) {
  const size_t count = soup.triangles.size();
  std::vector<uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  if (count <= kSampled) return order;
  std::vector<float> areas(count);
  for (size_t t = 0; t < count; ++t) areas[t] = soup.double_area(t);
  const auto larger = [&](uint32_t a, uint32_t b) {
    return areas[a] != areas[b] ? areas[a] > areas[b] : a < b;
  };
  const size_t largest = kSampled / 4;
  std::nth_element(order.begin(), order.begin() + largest, order.end(), larger);
  std::sort(order.begin() + largest, order.end());
  const size_t step = (count - largest) / (kSampled - largest);
  std::vector<uint32_t> chosen(order.begin(), order.begin() + largest);
  for (size_t i = largest; i < count; i += std::max<size_t>(step, 1)) chosen.push_back(order[i]);
  return chosen;
}

// The middle of a triangle and of its longest side.
std::array<Vec3, 2> points_of(const Soup& soup, uint32_t t) {
  const Vec3* p = &soup.positions[3 * size_t{t}];
  size_t longest = 0;
  for (size_t i = 1; i < 3; ++i)
    if (length(p[(i + 1) % 3] - p[i]) > length(p[(longest + 1) % 3] - p[longest])) longest = i;
  return {(p[0] + p[1] + p[2]) * (1.0f / 3.0f), (p[longest] + p[(longest + 1) % 3]) * 0.5f};
}

}  // namespace

ErrorMeter::ErrorMeter(const Source& source, const ClusterSet& clusters) : source_(source) {
  bvh_ = soup_of(clusters, [&](uint32_t v) { return position(v); }).bvh();
}

std::vector<std::vector<Vec3>> ErrorMeter::first_samples(const ClusterSet& clusters) const {
  std::vector<std::vector<Vec3>> samples(clusters.size());
  parallel_for(clusters.size(), 256, [&](size_t c) {
    const auto vertices = clusters.cluster_vertices(c);
    const size_t count = std::min(vertices.size(), kCarried);
    for (size_t i = 0; i < count; ++i)
      samples[c].push_back(position(vertices[i * vertices.size() / count]));
  });
  return samples;
}

Measured ErrorMeter::measure(const ClusterSet& made, std::span<const Vec3> samples,
                             uint32_t level) const {
  Measured result;
  if (made.triangle_count() == 0) return result;
  result.valid = true;
  const Soup soup = soup_of(made, [&](uint32_t v) { return position(v); });
  float farthest = 0;
  for (uint32_t t : triangles_to_sample(soup))
    for (const Vec3& p : points_of(soup, t))
      farthest = std::max(farthest, bvh_.closest_point(p).distance);

  struct Found {
    float distance;
    uint32_t cluster, sample;
  };
  std::vector<Found> found;
  const TriangleBvh bvh = soup.bvh();
  for (uint32_t i = 0; i < samples.size(); ++i) {
    const ClosestPoint at = bvh.closest_point(samples[i]);
    const auto next =
        std::upper_bound(made.triangle_offsets.begin(), made.triangle_offsets.end(), at.primitive);
    found.push_back(
        {at.distance, static_cast<uint32_t>(next - made.triangle_offsets.begin() - 1), i});
    farthest = std::max(farthest, at.distance);
  }
  result.distance = farthest / source_.scale;
  result.bound = kMargin * result.distance;

  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    if (a.cluster != b.cluster) return a.cluster < b.cluster;
    return a.distance != b.distance ? a.distance > b.distance : a.sample < b.sample;
  });
  const size_t carried = std::min(kCarried << std::min(level / 2, 8u), kMostCarried);
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
