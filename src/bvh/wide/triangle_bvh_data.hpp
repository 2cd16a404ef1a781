// What a Bvh holds: the nodes over a leaf store, flat arrays of words too.
#pragma once

#include <bit>
#include <cstdint>

#include "base/big_vector.hpp"
#include "base/math.hpp"
#include "bvh/wide/grid_node.hpp"
#include "query/leaf_store.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel {

/// Words of all nodes: what links can tell apart.
inline constexpr size_t kMaxNodeWords = size_t{2} * kLeafBit;

struct BvhData : LeafStore {
  // What a file has to hold.
  uint32_t width = 8;      ///< children a node: 2, 4 or 8
  uint32_t quantised = 0;  ///< 1: nodes are those of grid_node.hpp; 0: plain
  uint32_t max_depth = 0;  ///< of a leaf; the children of node 0 have depth 1
  uint32_t leaf_count = 0;
  uint32_t repeats = 0;  ///< 1: a triangle may be in more than one leaf
  bvh::CostModel cost;
  double sah_cost = 0, built_sah_cost = 0;  ///< of the binary tree; of it when it was built

  /// node_words() a node, which is if plain for each child its lowest x, then for each its highest
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

  /// What links to a node: half the number of its first word, which processors turn into an
  /// address in one instruction. Files have the node's number instead.
  uint32_t node_link(uint32_t node) const { return node * (node_words() / 2); }
  uint32_t linked_node(uint32_t link) const { return link / (node_words() / 2); }

  /// kNoChild for a child that is not there (children may follow it), a leaf's link, or a node's.
  uint32_t link(uint32_t node, uint32_t slot) const { return node_at(node)[links_at() + slot]; }

  /// A box that holds all below the child, and may be a little larger.
  Aabb box(uint32_t node, uint32_t slot) const {
    if (quantised) return grid::box(node_at(node), width, slot);
    const uint32_t* planes = node_at(node) + slot;
    const auto plane = [&](uint32_t i) { return std::bit_cast<float>(planes[i * width]); };
    return {{plane(0), plane(2), plane(4)}, {plane(1), plane(3), plane(5)}};
  }
  /// One a child; empty ones where there is none.
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

/// Only a name for Bvh's private part.
struct Bvh::Data : BvhData {};
inline Bvh::Data& Bvh::data() { return static_cast<Data&>(*store_); }
inline const Bvh::Data& Bvh::data() const { return static_cast<const Data&>(*store_); }

/// Chooses the kernels for this machine and what they need to know of the boxes. To be called
/// on every Data that was made, loaded or refitted. Throws kUnsupported where the machine lacks
/// the instructions asked for.
void prepare_rays(BvhData& data, Simd simd);
/// As before, after a change of boxes.
void prepare_rays(BvhData& data);

}  // namespace umbel
