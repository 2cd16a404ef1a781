#include "lod/build/triangle_distance_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "base/math.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

constexpr uint32_t kLanes = 4;

typedef float Lanes __attribute__((vector_size(16)));
typedef int32_t Mask __attribute__((vector_size(16)));

Lanes all(float x) { return Lanes{x, x, x, x}; }
Lanes select(Mask mask, Lanes a, Lanes b) { return mask ? a : b; }
// What is not a number becomes b.
Lanes max_or(Lanes a, Lanes b) { return select(a > b, a, b); }
Lanes min_or(Lanes a, Lanes b) { return select(a < b, a, b); }

struct Vec3Lanes {
  Lanes x, y, z;
};
Vec3Lanes operator-(const Vec3Lanes& a, const Vec3Lanes& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Lanes dot(const Vec3Lanes& a, const Vec3Lanes& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec3Lanes cross(const Vec3Lanes& a, const Vec3Lanes& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// From the end of `p` to the segment from the origin to the end of `side`.
Lanes to_segment(const Vec3Lanes& p, const Vec3Lanes& side) {
  const Lanes t = min_or(max_or(dot(p, side) / dot(side, side), all(0.0f)), all(1.0f));
  const Vec3Lanes d{p.x - t * side.x, p.y - t * side.y, p.z - t * side.z};
  return dot(d, d);
}

// Spreads five bits to every third.
uint32_t spread(uint32_t x) {
  x = (x | x << 8) & 0x100f;
  x = (x | x << 4) & 0x10c3;
  return (x | x << 2) & 0x1249;
}

}  // namespace

void TriangleDistanceTree::build(const ClusterSet& set, std::span<const Vec3> positions,
                                 float scale, bool in_parallel) {
  offsets_.assign(1, 0);
  for (uint32_t c = 0; c < set.size(); ++c) {
    const size_t triangles = set.cluster_corners(c).size() / 3;
    offsets_.push_back(offsets_.back() + static_cast<uint32_t>((triangles + kLanes - 1) / kLanes));
  }
  blocks_.resize(offsets_.back());
  cluster_of_.resize(offsets_.back());
  const auto fill = [&](size_t c) {
    fill_blocks(set, static_cast<uint32_t>(c), positions, scale, offsets_[c]);
  };
  if (in_parallel)
    parallel_for(set.size(), 64, fill);
  else
    for (size_t c = 0; c < set.size(); ++c) fill(c);
  build_tree();
}

void TriangleDistanceTree::fill_blocks(const ClusterSet& set, uint32_t cluster,
                                       std::span<const Vec3> positions, float scale,
                                       uint32_t first) {
  const auto vertices = set.cluster_vertices(cluster);
  const auto corners = set.cluster_corners(cluster);
  std::array<Vec3, 256> points;
  Aabb box;
  for (size_t i = 0; i < vertices.size(); ++i) {
    points[i] = positions[vertices[i]] * scale;
    extend(box, points[i]);
  }
  // Codes of the sums of corners, with the triangle's number behind.
  const Vec3 size = box.max - box.min;
  const auto per_cell = [](float extent) {
    const float cells = 31.0f / (3.0f * extent);
    return cells <= std::numeric_limits<float>::max() ? cells : 0.0f;  // flat, or as good as
  };
  const Vec3 cells{per_cell(size.x), per_cell(size.y), per_cell(size.z)};
  std::array<uint32_t, 256> order;
  const size_t count = corners.size() / 3;
  for (uint32_t t = 0; t < count; ++t) {
    const Vec3 sum = points[corners[3 * t]] + points[corners[3 * t + 1]] +
                     points[corners[3 * t + 2]] - box.min * 3.0f;
    // Far from the origin rounding may lead a few cells out of the box, even below it.
    const auto cell = [](float x) {
      return spread(static_cast<uint32_t>(static_cast<int32_t>(x)) & 31);
    };
    order[t] =
        (cell(sum.x * cells.x) << 2 | cell(sum.y * cells.y) << 1 | cell(sum.z * cells.z)) << 8 | t;
  }
  std::sort(order.begin(), order.begin() + count);
  for (size_t begin = 0; begin < count; begin += kLanes) {
    const size_t number = first + begin / kLanes;
    cluster_of_[number] = cluster;
    Block& block = blocks_[number];
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const size_t t = order[std::min(begin + lane, count - 1)] & 255;
      const Vec3 a = points[corners[3 * t]];
      const Vec3 ab = points[corners[3 * t + 1]] - a, ac = points[corners[3 * t + 2]] - a;
      block.a[0][lane] = a.x, block.a[1][lane] = a.y, block.a[2][lane] = a.z;
      block.ab[0][lane] = ab.x, block.ab[1][lane] = ab.y, block.ab[2][lane] = ab.z;
      block.ac[0][lane] = ac.x, block.ac[1][lane] = ac.y, block.ac[2][lane] = ac.z;
    }
  }
}

void TriangleDistanceTree::build_tree() {
  Node empty;
  for (int axis = 0; axis < 3; ++axis)
    empty.low[axis] = all(kInfinity), empty.high[axis] = all(-kInfinity);
  size_t below = blocks_.size();
  for (size_t level = 0;; ++level) {
    if (level == levels_.size()) levels_.emplace_back();
    std::vector<Node>& nodes = levels_[level];
    nodes.assign((below + kLanes - 1) / kLanes, empty);
    for (size_t i = 0; i < below; ++i) {
      Node& node = nodes[i / kLanes];
      for (int axis = 0; axis < 3; ++axis) {
        Lanes low, high;
        if (level == 0) {
          const Lanes a = blocks_[i].a[axis], b = a + blocks_[i].ab[axis],
                      c = a + blocks_[i].ac[axis];
          low = min_or(min_or(a, b), c);
          high = max_or(max_or(a, b), c);
        } else {
          low = levels_[level - 1][i].low[axis];
          high = levels_[level - 1][i].high[axis];
        }
        node.low[axis][i % kLanes] = std::min({low[0], low[1], low[2], low[3]});
        node.high[axis][i % kLanes] = std::max({high[0], high[1], high[2], high[3]});
      }
    }
    below = nodes.size();
    if (below > 1) continue;
    levels_.resize(level + 1);
    return;
  }
}

// In the triangle's plane where the point is above it, else to the nearest side.
TriangleDistanceTree::Lanes TriangleDistanceTree::squared_distances(const Block& block,
                                                                    const Vec3& point) {
  const Vec3Lanes ab{block.ab[0], block.ab[1], block.ab[2]};
  const Vec3Lanes ac{block.ac[0], block.ac[1], block.ac[2]};
  const Vec3Lanes p{all(point.x) - block.a[0], all(point.y) - block.a[1],
                    all(point.z) - block.a[2]};
  const Vec3Lanes bc = ac - ab, from_b = p - ab;
  const Lanes sides = min_or(min_or(to_segment(p, ab), to_segment(p, ac)), to_segment(from_b, bc));
  const Vec3Lanes n = cross(ab, ac);
  const Lanes size = dot(n, n), height = dot(p, n), none = all(0.0f);
  const Mask above = (size > none) & (dot(cross(ab, p), n) >= none) &
                     (dot(cross(p, ac), n) >= none) & (dot(cross(bc, from_b), n) >= none);
  return select(above, height * height / size, sides);
}

TriangleDistanceTree::Lanes TriangleDistanceTree::squared_distances(const Node& node,
                                                                    const Vec3& point) {
  const float p[3] = {point.x, point.y, point.z};
  Lanes sum = all(0.0f);
  for (int axis = 0; axis < 3; ++axis) {
    const Lanes at = all(p[axis]);
    const Lanes d = max_or(max_or(node.low[axis] - at, at - node.high[axis]), all(0.0f));
    sum += d * d;
  }
  return sum;
}

TriangleDistanceTree::Nearest TriangleDistanceTree::nearest(const Vec3& point, float enough,
                                                            uint32_t hint) const {
  Nearest best{kInfinity, 0, 0};
  if (blocks_.empty()) return best;
  const auto visit = [&](uint32_t b) {
    const Lanes d = squared_distances(blocks_[b], point);
    const float least = std::min(std::min(d[0], d[1]), std::min(d[2], d[3]));
    if (least < best.squared) best = {least, b, cluster_of_[b]};
    return best.squared <= enough;
  };
  struct Entry {
    float squared;
    uint32_t level, node;  // level 0: a block
  };
  std::array<Entry, 3 * 16 + 4> stack;
  size_t count = 0;
  // The nearest child ends on top.
  const auto push_children = [&](uint32_t level, uint32_t node, uint32_t but_for) {
    Lanes d = squared_distances(levels_[level - 1][node], point);
    if (but_for < kLanes) d[but_for] = kInfinity;
    const size_t first = count;
    for (uint32_t i = 0; i < kLanes; ++i) {
      if (!(d[i] < best.squared)) continue;
      size_t at = count++;
      for (; at > first && stack[at - 1].squared < d[i]; --at) stack[at] = stack[at - 1];
      stack[at] = {d[i], level - 1, kLanes * node + i};
    }
  };
  // From the hint upwards: what is near it in the tree comes first.
  uint32_t at = std::min(hint, static_cast<uint32_t>(blocks_.size() - 1));
  if (visit(at)) return best;
  for (uint32_t level = 1; level <= levels_.size(); ++level, at /= kLanes) {
    push_children(level, at / kLanes, at % kLanes);
    while (count > 0) {
      const Entry top = stack[--count];
      if (!(top.squared < best.squared)) continue;
      if (top.level > 0)
        push_children(top.level, top.node, kLanes);
      else if (visit(top.node))
        return best;
    }
  }
  return best;
}

}  // namespace umbel::lod
