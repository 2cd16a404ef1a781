// Follows moved vertices. Nodes are taken in blocks, in parallel: first the new corners go into the
// block's leaves, in the order of memory, then boxes follow upwards within the block, children
// before parents. What depends on other blocks is left for the end, and is little: children lie
// close behind their parents. The tree's shape stays, so its quality falls as the mesh deforms. By
// how much is told by the cost of the wide tree, before against after, because the binary tree that
// it came from is gone.
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "base/simd/float4.hpp"
#include "bvh/wide/wide_nodes.hpp"

namespace umbel {
namespace {

constexpr size_t kNodesAtOnce = 256, kVerticesAtOnce = size_t{1} << 14;
/// Rays take measurably longer from about here on (docs/bvh.md).
constexpr double kRebuildRatio = 1.5;

/// What visits cost, weighed by area and, for trees without any, each as one. Doubles, so that
/// nothing overflows or vanishes.
struct Cost {
  double by_area = 0, by_visits = 0;

  void add(const Aabb& box, double visit) {
    const double x = double(box.max.x) - box.min.x, y = double(box.max.y) - box.min.y;
    const double z = double(box.max.z) - box.min.z;
    by_area += visit * (x * y + y * z + z * x);
    by_visits += visit;
  }
  void add(const Cost& other) {
    by_area += other.by_area;
    by_visits += other.by_visits;
  }
  double relative_to(const Aabb& bounds) const {
    Cost root;
    root.add(bounds, 1);
    return root.by_area > 0 ? by_area / root.by_area : by_visits;
  }
};

/// What one block of nodes leaves to the others.
struct Block {
  Cost before, after;
  uint32_t unfinished = 0;  ///< how many nodes have a child in another block
};

/// A box as two vectors, whose fourth lanes mean nothing.
struct LaneBox {
  Float4 low = splat(std::numeric_limits<float>::infinity());
  Float4 high = splat(-std::numeric_limits<float>::infinity());

  void extend(const Float4& point) {
    low = min4(low, point);
    high = max4(high, point);
  }
  void extend(const LaneBox& other) {
    low = min4(low, other.low);
    high = max4(high, other.high);
  }
  Aabb bounds() const {
    float least[4], most[4];
    store4(least, low);
    store4(most, high);
    return {{least[0], least[1], least[2]}, {most[0], most[1], most[2]}};
  }
};

template <uint32_t kWidth, bool kQuantised>
class Refit {
 public:
  /// Takes all the memory that is needed, before anything changes.
  Refit(BvhData& data, const MeshView& mesh)
      : data_(data),
        mesh_(mesh),
        boxes_(data.node_count()),
        is_done_(data.node_count()),
        unfinished_(data.node_count()),
        blocks_((data.node_count() + kNodesAtOnce - 1) / kNodesAtOnce) {}

  /// Returns what the tree costs now as a multiple of what it cost before.
  double run() {
    parallel_chunks(data_.node_count(), kNodesAtOnce, [&](size_t begin, size_t end) {
      move_block(static_cast<uint32_t>(begin), static_cast<uint32_t>(end),
                 blocks_[begin / kNodesAtOnce]);
    });
    const Aabb old_bounds = data_.bounds;
    Cost before, after;
    for (size_t i = blocks_.size(); i-- > 0;) {
      const uint32_t* const unfinished = &unfinished_[i * kNodesAtOnce];
      for (const uint32_t node : std::span(unfinished, blocks_[i].unfinished)) {
        NodeBoxes boxes;
        if constexpr (kQuantised) boxes = leaf_boxes_of(node);
        move_inner_boxes(node, boxes);
        after.add(cost_of(node));
      }
      before.add(blocks_[i].before);
      after.add(blocks_[i].after);
    }
    data_.bounds = boxes_[0].bounds();
    before.add(old_bounds, data_.cost.traversal);
    after.add(data_.bounds, data_.cost.traversal);
    return after.relative_to(data_.bounds) / before.relative_to(old_bounds);
  }

 private:
  static constexpr uint32_t kNodesAhead = 128 / kWidth;
  static constexpr uint32_t kNodeWords = kQuantised ? grid::node_words(kWidth) : 7 * kWidth;
  using Corners = std::array<Triangle, size_t{kNodesAhead} * kWidth * kMaxLeafTriangles>;
  /// Of a node's children. Plain nodes take boxes one by one, those on grids when all are there.
  using NodeBoxes = std::array<Aabb, kQuantised ? kWidth : 0>;

  void move_block(uint32_t begin, uint32_t end, Block& block) {
    // Indices are gathered ahead of positions: two loops with nothing to wait for keep more of what
    // lies anywhere in memory under way than one.
    Corners corners;
    std::array<NodeBoxes, kNodesAtOnce> boxes;
    for (uint32_t node = begin; node < end; node += kNodesAhead) {
      const uint32_t next = std::min(node + kNodesAhead, end);
      gather_corners(node, next, corners);
      const Triangle* triangles = corners.data();
      for (uint32_t i = node; i < next; ++i) {
        block.before.add(cost_of(i));
        move_leaves_of(i, triangles, boxes[i - begin]);
      }
    }
    for (uint32_t node = end; node-- > begin;) {
      if (has_child_outside(node, end)) {
        unfinished_[begin + block.unfinished++] = node;
        continue;
      }
      move_inner_boxes(node, boxes[node - begin]);
      block.after.add(cost_of(node));
      is_done_[node] = 1;
    }
  }

  static uint32_t linked_node(uint32_t link) { return link / (kNodeWords / 2); }
  const uint32_t* links_of(uint32_t node) const {
    return data_.nodes.data() + size_t{node} * kNodeWords + (kNodeWords - kWidth);
  }
  uint32_t* leaf_words(uint32_t link) {
    return data_.leaves.data() + size_t{BvhData::first_reference(link)} * data_.reference_words();
  }
  template <typename Visit>
  void for_each_leaf(uint32_t node, const Visit& visit) {
    const uint32_t* links = links_of(node);
    for (uint32_t slot = 0; slot < kWidth; ++slot)
      if (links[slot] != kNoChild && BvhData::is_leaf(links[slot])) visit(slot, links[slot]);
  }

  void gather_corners(uint32_t begin, uint32_t end, Corners& corners) {
    Triangle* next = corners.data();
    for (uint32_t node = begin; node < end; ++node)
      for_each_leaf(node, [&](uint32_t, uint32_t link) {
        const uint32_t n = BvhData::leaf_size(link);
        const uint32_t* primitives = leaf_words(link) + size_t{data_.corner_words()} * n;
        for (uint32_t i = 0; i < n; ++i) *next++ = mesh_.triangles[primitives[i]];
      });
  }

  /// Leaves the box of the leaves in boxes_, and `triangles` behind theirs.
  void move_leaves_of(uint32_t node, const Triangle*& triangles, NodeBoxes& boxes) {
    LaneBox all;
    for_each_leaf(node, [&](uint32_t slot, uint32_t link) {
      const LaneBox box = move_leaf(link, triangles);
      triangles += BvhData::leaf_size(link);
      set_box(node, slot, box, boxes);
      all.extend(box);
    });
    boxes_[node] = all;
  }

  void set_box(uint32_t node, uint32_t slot, const LaneBox& box, NodeBoxes& boxes) {
    if constexpr (kQuantised)
      boxes[slot] = box.bounds();
    else
      data_.set_box(node, slot, box.bounds());
  }

  /// Of the leaves' triangles, which have moved.
  NodeBoxes leaf_boxes_of(uint32_t node) {
    NodeBoxes boxes;
    for_each_leaf(node, [&](uint32_t slot, uint32_t link) {
      data_.for_each_triangle(link, [&](const LeafTriangle& t) {
        for (const Vec3& p : {t.p0, t.p1, t.p2}) extend(boxes[slot], p);
      });
    });
    return boxes;
  }

  LaneBox move_leaf(uint32_t link, const Triangle* triangles) {
    const uint32_t n = BvhData::leaf_size(link);
    uint32_t* const words = leaf_words(link);
    if (data_.compact) return move_vertices(words, n, triangles);
    return n == 1 ? move_triangle(words, triangles[0]) : move_triangles(words, n, triangles);
  }

  Float4 position(uint32_t vertex) const {
    const Vec3& p = mesh_.positions[vertex];
    // Four floats are read at once, but nothing behind the last vertex.
    if (&p != last_) [[likely]]
      return load4(reinterpret_cast<const float*>(&p));
    const float padded[4] = {p.x, p.y, p.z, 0};
    return load4(padded);
  }

  LaneBox move_triangle(uint32_t* words, const Triangle& triangle) {
    LaneBox box;
    for (uint32_t corner = 0; corner < 3; ++corner) {
      box.extend(position(triangle[corner]));
      std::memcpy(words + size_t{3} * corner, &mesh_.positions[triangle[corner]], sizeof(Vec3));
    }
    return box;
  }

  /// The same corner of four of n triangles, the last one again where there are fewer.
  std::array<Float4, 4> four_corners(const Triangle* triangles, uint32_t first, uint32_t n,
                                     uint32_t corner, LaneBox& box) const {
    const auto at = [&](uint32_t i) {
      return position(triangles[std::min(first + i, n - 1)][corner]);
    };
    std::array<Float4, 4> four = {at(0), at(1), at(2), at(3)};
    for (const Float4& p : four) box.extend(p);
    transpose(four[0], four[1], four[2], four[3]);
    return four;
  }

  /// Of at least two triangles. Rows are written four words at a time, in their order, so that each
  /// overwrites what was written beyond the one before. What is written beyond the last, which is
  /// over some primitives' numbers, is put back.
  LaneBox move_triangles(uint32_t* words, uint32_t n, const Triangle* triangles) {
    auto* const rows = reinterpret_cast<float*>(words);
    uint32_t* const primitives = words + size_t{9} * n;
    const std::array<uint32_t, 3> kept = {primitives[0], primitives[1], primitives[2]};
    LaneBox box;
    for (uint32_t corner = 0; corner < 3; ++corner) {
      float* const row = rows + size_t{3} * corner * n;
      const std::array<Float4, 4> first = four_corners(triangles, 0, n, corner, box);
      if (n <= 4) {
        for (size_t axis = 0; axis < 3; ++axis) store4(row + axis * n, first[axis]);
        continue;
      }
      const std::array<Float4, 4> second = four_corners(triangles, 4, n, corner, box);
      for (size_t axis = 0; axis < 3; ++axis) {
        store4(row + axis * n, first[axis]);
        store4(row + axis * n + 4, second[axis]);
      }
    }
    for (uint32_t i = 0; i < (n <= 4 ? 4 : 8) - n; ++i) primitives[i] = kept[i];
    return box;
  }

  LaneBox move_vertices(const uint32_t* words, uint32_t n, const Triangle* triangles) {
    LaneBox box;
    for (uint32_t corner = 0; corner < 3; ++corner)
      for (uint32_t i = 0; i < n; ++i) {
        const uint32_t vertex = triangles[i][corner];
        box.extend(position(vertex));
        move_vertex(data_.vertices[words[corner * n + i]], mesh_.positions[vertex]);
      }
    return box;
  }

  /// Several leaves may do so at once: all say the same.
  static void move_vertex(Vec3& vertex, const Vec3& p) {
    std::atomic_ref(vertex.x).store(p.x, std::memory_order_relaxed);
    std::atomic_ref(vertex.y).store(p.y, std::memory_order_relaxed);
    std::atomic_ref(vertex.z).store(p.z, std::memory_order_relaxed);
  }

  bool has_child_outside(uint32_t node, uint32_t end) const {
    const uint32_t* links = links_of(node);
    return std::any_of(links, links + kWidth, [&](uint32_t link) {
      if (BvhData::is_leaf(link)) return false;
      const uint32_t child = linked_node(link);
      return child >= end || !is_done_[child];
    });
  }

  /// `boxes` has those of the leaves.
  void move_inner_boxes(uint32_t node, NodeBoxes& boxes) {
    const uint32_t* links = links_of(node);
    for (uint32_t slot = 0; slot < kWidth; ++slot) {
      if (BvhData::is_leaf(links[slot])) continue;
      const LaneBox& box = boxes_[linked_node(links[slot])];
      set_box(node, slot, box, boxes);
      boxes_[node].extend(box);
    }
    if constexpr (kQuantised) data_.set_boxes(node, boxes.data());
  }

  /// Of the visits of a node's children.
  Cost cost_of(uint32_t node) const {
    const uint32_t* links = links_of(node);
    const typename WideNodes<kWidth, kQuantised>::Children children(links - (kNodeWords - kWidth));
    const float* const planes = children.boxes().planes;
    std::array<double, kWidth> visits, areas;
    for (uint32_t i = 0; i < kWidth; ++i) {
      const double leaf = double(data_.cost.intersection) * BvhData::leaf_size(links[i]);
      visits[i] = BvhData::is_leaf(links[i]) ? leaf : double(data_.cost.traversal);
      const double x = double(planes[kWidth + i]) - planes[i];
      const double y = double(planes[3 * kWidth + i]) - planes[2 * kWidth + i];
      const double z = double(planes[5 * kWidth + i]) - planes[4 * kWidth + i];
      areas[i] = x * y + y * z + z * x;
    }
    Cost sum;
    for (uint32_t i = 0; i < kWidth; ++i) {
      if (links[i] == kNoChild) continue;
      sum.by_visits += visits[i];
      sum.by_area += visits[i] * areas[i];
    }
    return sum;
  }

  BvhData& data_;
  const MeshView& mesh_;
  const Vec3* last_ = mesh_.positions.data() + mesh_.positions.size() - 1;
  BigVector<LaneBox> boxes_;  ///< of all below a node, once it is done
  BigVector<uint8_t> is_done_;
  /// Nodes of each block, from its first one's place on, the last one first.
  BigVector<uint32_t> unfinished_;
  std::vector<Block> blocks_;
};

bool any_vertex_is_not_finite(std::span<const Vec3> positions) {
  std::vector<uint8_t> bad((positions.size() + kVerticesAtOnce - 1) / kVerticesAtOnce);
  parallel_chunks(positions.size(), kVerticesAtOnce, [&](size_t begin, size_t end) {
    // As integers, whose sums and comparisons compilers turn into vectors: an exponent of ones.
    const auto* const numbers = reinterpret_cast<const float*>(positions.data() + begin);
    int32_t is_bad = 0;
    for (size_t i = 0; i < 3 * (end - begin); ++i)
      is_bad |= (std::bit_cast<int32_t>(numbers[i]) & 0x7fffffff) > 0x7f7fffff ? -1 : 0;
    bad[begin / kVerticesAtOnce] = is_bad != 0;
  });
  return std::find(bad.begin(), bad.end(), 1) != bad.end();
}

bool any_index_is_out_of_range(const MeshView& mesh) {
  const auto count = static_cast<uint32_t>(std::min<size_t>(mesh.positions.size(), kNone));
  std::vector<uint8_t> bad((mesh.triangles.size() + kVerticesAtOnce - 1) / kVerticesAtOnce);
  parallel_chunks(mesh.triangles.size(), kVerticesAtOnce, [&](size_t begin, size_t end) {
    const auto* const indices = reinterpret_cast<const uint32_t*>(mesh.triangles.data() + begin);
    uint32_t is_bad = 0;
    for (size_t i = 0; i < 3 * (end - begin); ++i) is_bad |= indices[i] >= count ? ~0u : 0u;
    bad[begin / kVerticesAtOnce] = is_bad != 0;
  });
  return std::find(bad.begin(), bad.end(), 1) != bad.end();
}

/// Only what the tree holds: triangles that were dropped at the build may still be invalid.
void check_triangles(const BvhData& data, const MeshView& mesh) {
  for (uint32_t node = 0; node < data.node_count(); ++node)
    for (uint32_t slot = 0; slot < data.width; ++slot) {
      const uint32_t link = data.link(node, slot);
      if (link == kNoChild || !BvhData::is_leaf(link)) continue;
      data.for_each_triangle(link, [&](const LeafTriangle& t) {
        for (const uint32_t vertex : mesh.triangles[t.primitive]) {
          if (vertex >= mesh.positions.size())
            throw Error(ErrorCode::kInvalidMesh,
                        "triangle " + std::to_string(t.primitive) + ": vertex index " +
                            std::to_string(vertex) + " is out of range, the mesh has " +
                            std::to_string(mesh.positions.size()) + " vertices");
          if (!is_finite(mesh.positions[vertex]))
            throw Error(ErrorCode::kInvalidMesh, "triangle " + std::to_string(t.primitive) +
                                                     ": the position of vertex " +
                                                     std::to_string(vertex) + " is not finite");
        }
      });
    }
}

void check_mesh(const BvhData& data, const MeshView& mesh) {
  if (mesh.triangles.size() != data.triangle_count)
    throw Error(ErrorCode::kInvalidArgument, "refit takes the triangles of the build, which were " +
                                                 std::to_string(data.triangle_count) +
                                                 ", but the mesh has " +
                                                 std::to_string(mesh.triangles.size()));
  if (any_index_is_out_of_range(mesh) || any_vertex_is_not_finite(mesh.positions))
    check_triangles(data, mesh);
}

}  // namespace

RefitReport Bvh::refit(const MeshView& mesh, const BuildOptions& options) {
  BvhData& data = this->data();
  Progress progress(options);
  progress.report(0, "refit");
  with_threads(options.threads, [&] {
    check_mesh(data, mesh);
    if (!data.nodes.empty())
      with_width(data.width, [&](auto width) {
        data.sah_cost *= data.quantised ? Refit<width, true>(data, mesh).run()
                                        : Refit<width, false>(data, mesh).run();
      });
    prepare_rays(data);
  });
  progress.report(1, "refit");
  return {data.sah_cost, data.built_sah_cost, data.sah_cost > kRebuildRatio * data.built_sah_cost};
}

}  // namespace umbel
