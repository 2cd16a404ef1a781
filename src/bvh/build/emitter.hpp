// Where a builder writes the nodes and primitives of a subtree, depth-first. What was written last
// can be taken back, so a subtree that is cheaper as one leaf becomes one as soon as it is known.
#pragma once

#include <cstdint>

#include "base/simd/box4.hpp"
#include "bvh/tree/box_node.hpp"

namespace umbel::bvh {

/// A finished subtree: its box, and its cost (not divided by the root's area).
struct BuiltSubtree {
  Box4 box;
  float cost;
};

struct Emitter {
  Node* nodes;           ///< the root is nodes[0]
  uint32_t* primitives;  ///< leaves count from here
  CostModel cost;
  uint32_t max_leaf_size;
  uint32_t max_depth;
  uint32_t node_count = 1;
  uint32_t primitive_count = 0;

  uint32_t add_pair() {
    node_count += 2;
    return node_count - 2;
  }

  /// Makes a leaf of the `count` primitives that were written last, in the order that they have.
  BuiltSubtree make_leaf(uint32_t slot, uint32_t count, const Box4& box, float area) const {
    nodes[slot] = node_of(box, primitive_count - count, count);
    return {box, cost.intersection * float(count) * area};
  }

  /// Joins the children at `pair`, whose `count` primitives and whose nodes were written last.
  BuiltSubtree join(uint32_t slot, uint32_t pair, uint32_t count, const BuiltSubtree& left,
                    const BuiltSubtree& right, Float4 pad) {
    Box4 box = left.box;
    box.extend(right.box);
    const float area = box.half_area(pad);
    const float split = cost.traversal * area + left.cost + right.cost;
    if (count <= max_leaf_size && cost.intersection * float(count) * area <= split) {
      node_count = pair;
      return make_leaf(slot, count, box, area);
    }
    nodes[slot] = node_of(box, pair, 0);
    return {box, split};
  }
};

}  // namespace umbel::bvh
