// What a TriangleBvh holds: flat arrays of words and a few numbers, nothing that points, so that
// a file is a dump of them. Queries other than rays go through the accessors alone, and so do
// not depend on how nodes and leaves are laid out.
#pragma once

#include <bit>
#include <cstdint>

#include "base/big_vector.hpp"
#include "base/math.hpp"
#include "bvh/wide/grid_node.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel {

/// No child in this slot.
inline constexpr uint32_t kNoChild = 0xffffffffu;
/// A link to a leaf: this bit, then triangles - 1 in 3 bits, then the first reference. All ones
/// would be a leaf of 8 at the last reference that can be numbered, and is not used.
inline constexpr uint32_t kLeafBit = 0x80000000u;
inline constexpr uint32_t kLeafSizeShift = 28;
inline constexpr uint32_t kMaxLeafTriangles = 8;
inline constexpr uint32_t kLeafPadding = 8;
/// Words of all nodes: what links can tell apart.
inline constexpr size_t kMaxNodeWords = size_t{2} * kLeafBit;
inline constexpr uint32_t kMaxReferences = (1u << kLeafSizeShift) - kMaxLeafTriangles;

struct RayKernels;
struct ShapeKernels;

/// One triangle of a leaf, with the very floats of the mesh it came from.
struct LeafTriangle {
  Vec3 p0, p1, p2;
  uint32_t primitive;
  uint32_t mask;
};

/// The triangles of a structure's leaves, what rays have to know of their size, and the queries.
struct LeafStore {
  LeafStore() = default;
  LeafStore(const LeafStore&) = default;
  LeafStore(LeafStore&&) = default;
  LeafStore& operator=(const LeafStore&) = default;
  LeafStore& operator=(LeafStore&&) = default;
  virtual ~LeafStore() = default;

  uint32_t triangle_count = 0;  ///< of the mesh, dropped ones included
  uint32_t reference_count = 0;
  uint32_t compact = 0;  ///< 1: leaves hold vertex numbers; 0: they hold corners
  uint32_t masked = 0;   ///< 1: leaves hold masks; 0: all bits are set in all masks
  Aabb bounds;           ///< of the triangles; empty where there are none

  /// reference_words() a reference. A leaf of n triangles is n times that many consecutive words:
  /// n times p0.x, n times p0.y, ... n times p2.z (compact: n times each vertex number), n times
  /// the primitive's number, n times its mask where masked. kLeafPadding words follow the last
  /// one, so that eight lanes can be loaded at any row.
  BigVector<uint32_t> leaves;
  BigVector<Vec3> vertices;  ///< compact: what the vertex numbers mean; else empty

  // Set by prepare_scale, never stored.
  /// The largest coordinate of any box on each axis, by amount.
  alignas(16) float reach[4] = {};
  float scale = 1;    ///< power of two that brings triangles of extreme size into a safe range
  float unscale = 1;  ///< 1 / scale

  // Set with the structure's nodes, never stored.
  const RayKernels* rays = nullptr;
  const ShapeKernels* shapes = nullptr;

  uint32_t corner_words() const { return compact ? 3 : 9; }
  uint32_t reference_words() const { return corner_words() + 1 + masked; }
  uint64_t leaf_bytes() const {
    return leaves.size() * sizeof(uint32_t) + vertices.size() * sizeof(Vec3);
  }

  static bool is_leaf(uint32_t link) { return (link & kLeafBit) != 0; }
  static uint32_t leaf_size(uint32_t link) { return ((link >> kLeafSizeShift) & 7u) + 1; }
  static uint32_t first_reference(uint32_t link) { return link & ((1u << kLeafSizeShift) - 1); }
  /// The link of the leaf of 1 to 8 triangles that begins there.
  static uint32_t leaf_link(uint32_t first, uint32_t count) {
    return kLeafBit | (count - 1) << kLeafSizeShift | first;
  }

  /// Triangle i of a leaf, 0 <= i < leaf_size(link).
  LeafTriangle triangle(uint32_t link, uint32_t i) const {
    const uint32_t n = leaf_size(link), rows = corner_words();
    const uint32_t* words = leaves.data() + size_t{first_reference(link)} * reference_words() + i;
    LeafTriangle result{};
    if (compact) {
      result.p0 = vertices[words[0]];
      result.p1 = vertices[words[n]];
      result.p2 = vertices[words[2 * n]];
    } else {
      const auto row = [&](uint32_t r) { return std::bit_cast<float>(words[r * n]); };
      result.p0 = {row(0), row(1), row(2)};
      result.p1 = {row(3), row(4), row(5)};
      result.p2 = {row(6), row(7), row(8)};
    }
    result.primitive = words[rows * n];
    result.mask = masked ? words[(rows + 1) * n] : 0xffffffffu;
    return result;
  }
  template <typename Visit>
  void for_each_triangle(uint32_t link, const Visit& visit) const {
    for (uint32_t i = 0; i < leaf_size(link); ++i) visit(triangle(link, i));
  }
};

struct TriangleBvhData : LeafStore {
  // What a file has to hold.
  uint32_t width = 8;      ///< slots a node: 2, 4 or 8
  uint32_t quantised = 0;  ///< 1: nodes are those of grid_node.hpp; 0: plain
  uint32_t max_depth = 0;  ///< of a leaf; the children of node 0 have depth 1
  uint32_t leaf_count = 0;
  uint32_t repeats = 0;  ///< 1: a triangle may be in more than one leaf
  bvh::CostModel cost;
  double sah_cost = 0, built_sah_cost = 0;  ///< of the binary tree; of it when it was built

  /// node_words() a node, which is if plain for each slot its lowest x, then for each its highest
  /// x, the same for y and z, then its link (see box(), link()). Children come after their parent,
  /// node 0 is the root; there are none without triangles.
  BigVector<uint32_t> nodes;

  // Set by prepare_rays, never stored.
  Simd simd = Simd::kAuto;  ///< as asked for

  uint32_t node_words() const { return quantised ? grid::node_words(width) : 7 * width; }
  uint32_t links_at() const { return quantised ? grid::links_at(width) : 6 * width; }
  uint32_t* node_at(uint32_t node) { return nodes.data() + size_t{node} * node_words(); }
  const uint32_t* node_at(uint32_t node) const {
    return nodes.data() + size_t{node} * node_words();
  }
  uint32_t node_count() const {
    return width == 0 ? 0 : static_cast<uint32_t>(nodes.size() / node_words());
  }
  /// Nodes and triangles: everything that a query may touch.
  uint64_t bytes() const { return nodes.size() * sizeof(uint32_t) + leaf_bytes(); }

  /// What links to a node: half the number of its first word, which processors make an address of
  /// without further ado. Files have the node's number instead.
  uint32_t node_link(uint32_t node) const { return node * (node_words() / 2); }
  uint32_t linked_node(uint32_t link) const { return link / (node_words() / 2); }

  /// kNoChild for a slot without a child (which may lie between slots that have one), a leaf's
  /// link, or a node's.
  uint32_t link(uint32_t node, uint32_t slot) const { return node_at(node)[links_at() + slot]; }

  /// A box that holds all below the slot, and may be a little larger.
  Aabb box(uint32_t node, uint32_t slot) const {
    if (quantised) return grid::box(node_at(node), width, slot);
    const uint32_t* planes = node_at(node) + slot;
    const auto plane = [&](uint32_t i) { return std::bit_cast<float>(planes[i * width]); };
    return {{plane(0), plane(2), plane(4)}, {plane(1), plane(3), plane(5)}};
  }
  /// One a slot; empty ones where there is no child.
  void set_boxes(uint32_t node, const Aabb* boxes) {
    if (quantised) return grid::set_boxes(node_at(node), width, boxes);
    for (uint32_t slot = 0; slot < width; ++slot) set_box(node, slot, boxes[slot]);
  }
  /// Of a plain node.
  void set_box(uint32_t node, uint32_t slot, const Aabb& box) {
    uint32_t* planes = node_at(node) + slot;
    const float values[6] = {box.min.x, box.max.x, box.min.y, box.max.y, box.min.z, box.max.z};
    for (uint32_t i = 0; i < 6; ++i) planes[i * width] = std::bit_cast<uint32_t>(values[i]);
  }
  void set_link(uint32_t node, uint32_t slot, uint32_t link) {
    node_at(node)[links_at() + slot] = link;
  }
};

/// Only a name for TriangleBvh's private part.
struct TriangleBvh::Data : TriangleBvhData {};
inline TriangleBvh::Data& TriangleBvh::data() { return static_cast<Data&>(*store_); }
inline const TriangleBvh::Data& TriangleBvh::data() const {
  return static_cast<const Data&>(*store_);
}

/// Chooses the kernels for this machine and what they need to know of the boxes. To be called
/// on every Data that was made, loaded or refitted. Throws kUnsupported where the machine lacks
/// the instructions asked for.
void prepare_rays(TriangleBvhData& data, Simd simd);
/// As before, after a change of boxes.
void prepare_rays(TriangleBvhData& data);

}  // namespace umbel
