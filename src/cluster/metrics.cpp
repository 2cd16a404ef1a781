// Measures of clusters. `surface_area_ratio` is the expected number of cluster boxes that a
// random line through the box of all pierces (Crofton); `overlap` counts them on sampled lines,
// and so checks the former independently.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/radix_sort.hpp"
#include "cluster/source.hpp"
#include "cluster/validate.hpp"
#include "cluster/vertex_table.hpp"
#include "umbel/cluster.hpp"

namespace umbel {
namespace {

using Double3 = std::array<double, 3>;

double area(const Aabb& b) {
  if (is_empty(b)) return 0;
  const double x = double(b.max.x) - b.min.x, y = double(b.max.y) - b.min.y,
               z = double(b.max.z) - b.min.z;
  return x * y + y * z + z * x;
}

// Uniform numbers in [0, 1) from a counter (Steele et al., SplitMix64, 2014), so that every line
// is the same whichever thread draws it.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15ull) {}
  double next() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15ull;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ z >> 27) * 0x94d049bb133111ebull;
    return double((z ^ z >> 31) >> 11) * 0x1p-53;
  }

 private:
  uint64_t state_;
};

struct Line {
  Double3 origin, direction;
};

struct DoubleBox {
  explicit DoubleBox(const Aabb& box)
      : low{box.min.x, box.min.y, box.min.z}, high{box.max.x, box.max.y, box.max.z} {}
  Double3 low, high;
};

// A uniform line that meets the box: it enters at a uniform point of the faces, in a direction that
// is as likely as its cosine with the face's normal.
Line random_line(Random& random, const DoubleBox& box) {
  const auto extent = [&](size_t axis) { return box.high[axis] - box.low[axis]; };
  Double3 faces;
  for (size_t k = 0; k < 3; ++k) faces[k] = extent((k + 1) % 3) * extent((k + 2) % 3);
  const double face = random.next() * (faces[0] + faces[1] + faces[2]);
  const size_t k = face < faces[0] ? 0 : face < faces[0] + faces[1] ? 1 : 2;
  const size_t a = (k + 1) % 3, b = (k + 2) % 3;
  const bool from_high = random.next() < 0.5;
  Line line;
  line.origin[k] = (from_high ? box.high : box.low)[k];
  line.origin[a] = box.low[a] + random.next() * extent(a);
  line.origin[b] = box.low[b] + random.next() * extent(b);
  const double square = random.next(), phi = 2 * std::numbers::pi * random.next();
  const double cosine = std::sqrt(1 - square), sine = std::sqrt(square);
  line.direction[k] = from_high ? -cosine : cosine;
  line.direction[a] = sine * std::cos(phi);
  line.direction[b] = sine * std::sin(phi);
  return line;
}

bool pierces(const Line& line, const DoubleBox& box) {
  double near = -HUGE_VAL, far = HUGE_VAL;
  for (size_t k = 0; k < 3; ++k) {
    const double inverse = 1 / line.direction[k];
    double a = (box.low[k] - line.origin[k]) * inverse,
           b = (box.high[k] - line.origin[k]) * inverse;
    if (a > b) std::swap(a, b);
    near = std::max(near, a);
    far = std::min(far, b);
  }
  return near <= far;
}

double sampled_overlap(const std::vector<Aabb>& boxes, const Aabb& bounds) {
  if (boxes.empty() || area(bounds) == 0) return 0;
  constexpr size_t kLines = 4096, kChunk = 64;
  std::vector<uint64_t> hits(kLines / kChunk);
  parallel_chunks(kLines, kChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Random random(i + 1);
      const Line line = random_line(random, DoubleBox(bounds));
      for (const Aabb& box : boxes) hits[begin / kChunk] += pierces(line, DoubleBox(box));
    }
  });
  return double(std::accumulate(hits.begin(), hits.end(), uint64_t(0))) / double(kLines);
}

// The weight of explicit connections that leave their cluster, over the cluster's items.
double explicit_ratio_cut(const ClusterInput& input, const Clusters& clusters,
                          const std::vector<uint32_t>& cluster_of) {
  const Connections& c = input.connections;
  if (c.ranges.empty()) return 0;
  double sum = 0;
  for (const Range& r : clusters.ranges) {
    double cut = 0;
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
      const uint32_t item = clusters.items[i];
      const Range& list = c.ranges[item];
      for (uint32_t k = list.offset; k < list.offset + list.count; ++k)
        if (cluster_of[c.targets[k]] != cluster_of[item]) cut += cluster::weight_of(c, k);
    }
    sum += cut / r.count;
  }
  return sum;
}

// The same for shared vertices: l of a vertex's m items being in a cluster cuts l (m - l) pairs.
double vertex_ratio_cut(const ClusterInput& input, const Clusters& clusters,
                        const std::vector<uint32_t>& cluster_of) {
  const uint32_t arity = input.vertices_per_item;
  if (input.item_vertices.empty() || input.shared_vertex_weight == 0) return 0;
  std::vector<uint64_t> uses;
  uses.reserve(input.item_vertices.size());
  for (size_t i = 0; i < input.boxes.size(); ++i) {
    const uint32_t* v = input.item_vertices.data() + i * arity;
    for (uint32_t k = 0; k < arity; ++k)
      if (std::find(v, v + k, v[k]) == v + k) uses.push_back(uint64_t(v[k]) << 32 | cluster_of[i]);
  }
  std::sort(uses.begin(), uses.end());
  std::vector<double> cuts(clusters.ranges.size(), 0);
  for (size_t begin = 0, end = 0; begin < uses.size(); begin = end) {
    while (end < uses.size() && uses[end] >> 32 == uses[begin] >> 32) ++end;
    for (size_t a = begin, b = begin; a < end; a = b) {
      while (b < end && uses[b] == uses[a]) ++b;
      const uint32_t cluster = static_cast<uint32_t>(uses[a]);
      if (cluster != kNone) cuts[cluster] += double(b - a) * double((end - begin) - (b - a));
    }
  }
  double sum = 0;
  for (size_t c = 0; c < cuts.size(); ++c) sum += cuts[c] / clusters.ranges[c].count;
  return sum * input.shared_vertex_weight;
}

void check(const ClusterInput& input, const Clusters& clusters) {
  for (size_t c = 0; c < clusters.ranges.size(); ++c) {
    const Range& r = clusters.ranges[c];
    if (r.count == 0 || uint64_t(r.offset) + r.count > clusters.items.size())
      throw Error(ErrorCode::kInvalidArgument,
                  "clusters.ranges[" + std::to_string(c) + "] is empty or ends past the items");
  }
  for (size_t i = 0; i < clusters.items.size(); ++i)
    if (clusters.items[i] >= input.boxes.size())
      throw Error(ErrorCode::kInvalidArgument, "clusters.items[" + std::to_string(i) + "] is " +
                                                   std::to_string(clusters.items[i]) +
                                                   ", but there are " +
                                                   std::to_string(input.boxes.size()) + " items");
}

}  // namespace

ClusterMetrics cluster_metrics(const ClusterInput& input, const Clusters& clusters,
                               uint32_t max_items) {
  cluster::validate_layout(input, ClusterConfig{});
  if (max_items == 0)
    throw Error(ErrorCode::kInvalidArgument, "max_items must be at least 1, not 0");
  check(input, clusters);
  cluster::validate_all_boxes(input);
  ClusterMetrics m;
  m.clusters = clusters.ranges.size();
  if (m.clusters == 0) return m;
  const uint32_t arity = input.item_vertices.empty() ? 0 : input.vertices_per_item;
  std::vector<Aabb> boxes(m.clusters);
  std::vector<uint32_t> cluster_of(input.boxes.size(), kNone);
  cluster::VertexTable table;
  Aabb bounds;
  uint64_t items = 0, vertices = 0;
  double areas = 0, weighted = 0;
  m.min_size = kNone;
  for (size_t c = 0; c < m.clusters; ++c) {
    const Range& r = clusters.ranges[c];
    table.clear(size_t(r.count) * arity);
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
      const uint32_t item = clusters.items[i];
      cluster_of[item] = static_cast<uint32_t>(c);
      extend(boxes[c], input.boxes[item]);
      for (uint32_t k = 0; k < arity; ++k)
        table.insert(input.item_vertices[size_t(item) * arity + k]);
    }
    extend(bounds, boxes[c]);
    items += r.count;
    vertices += table.count();
    areas += area(boxes[c]);
    weighted += area(boxes[c]) * r.count;
    m.min_size = std::min(m.min_size, r.count);
    m.max_size = std::max(m.max_size, r.count);
    m.max_vertices = std::max(m.max_vertices, table.count());
  }
  m.mean_fill = double(items) / (double(m.clusters) * max_items);
  m.mean_vertices = double(vertices) / double(m.clusters);
  if (const double whole = area(bounds); whole > 0) {
    m.surface_area_ratio = areas / whole;
    m.sah = weighted / whole;
  }
  m.overlap = sampled_overlap(boxes, bounds);
  m.ratio_cut = explicit_ratio_cut(input, clusters, cluster_of) +
                vertex_ratio_cut(input, clusters, cluster_of);
  return m;
}

}  // namespace umbel
