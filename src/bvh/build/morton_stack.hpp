// The radix tree over sorted Morton codes in one pass on a processor: codes are read from the last
// to the first with a stack of finished subtrees, and the two on top become one as soon as they
// have more leading bits in common than the next code has with them (the bottom-up order of
// Apetrei, "Fast and Simple Agglomerative LBVH Construction", 2014, without its atomics). Boxes,
// costs and leaves are done while a subtree is still in the first-level cache.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/simd/box4.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/radix_splits.hpp"
#include "bvh/build/tree_parts.hpp"
#include "bvh/tree/box_node.hpp"
#include "bvh/tree/leaf_rule.hpp"

namespace umbel::bvh {

/// Builds subtrees over ranges of sorted codes.
template <typename Key>
class MortonStack {
 public:
  MortonStack(const Key* codes, const uint32_t* primitives, Boxes boxes, LeafRule rule)
      : codes_(codes), primitives_(primitives), boxes_(boxes.data()), rule_(rule) {}

  /// The range is a subtree of the radix tree. Its nodes are written before `nodes_end`, where
  /// there is room for two a code.
  TreePart build(uint32_t begin, uint32_t end, Node* nodes_end) const {
    Subtree below[kDeepest];  // the last one is to the right of the subtree that grows
    below[0].bits = -2;       // fewer than any two have in common
    Subtree* top = below;
    Node* next = nodes_end;
    Subtree grown;
    for (uint32_t i = end; i-- > begin;) {
      constexpr uint32_t kAhead = 12;
      if (i >= begin + kAhead) __builtin_prefetch(&boxes_[primitives_[i - kAhead]]);
      grown.box = Box4::load(boxes_[primitives_[i]]);
      grown.first = i;
      grown.count = 1;
      grown.end = i + 1;
      grown.pairs = 0;
      grown.cost = rule_.intersection * grown.box.half_area(splat(0));
      grown.bits = i == begin ? -1 : common_bits(codes_, i - 1, i);
      for (; top->bits > grown.bits; --top) next = join(grown, *top, i, next, nodes_end);
      *++top = grown;
    }
    return {node_of(grown.box, grown.first, grown.count), grown.pairs, nodes_end, 0};
  }

 private:
  // Bits in common rise towards the top, and there are at most 96 of them.
  static constexpr size_t kDeepest = 100;

  struct Subtree {
    Box4 box;
    uint32_t first, count;  ///< of its node
    uint32_t end;           ///< of the codes below
    uint32_t pairs;         ///< of nodes, written for it
    float cost;             ///< without meaning for those that are too large for a leaf
    int bits;               ///< in common with what lies to its left
  };

  /// Two subtrees become one, which begins at `begin`. What it is to be, a node or a leaf, cannot
  /// be predicted, so there are no branches. Returns where the nodes begin now.
  Node* join(Subtree& left, const Subtree& right, uint32_t begin, Node* next,
             const Node* nodes_end) const {
    store(next - 2, left);
    store(next - 1, right);
    left.box.extend(right.box);
    left.end = right.end;
    const uint32_t count = left.end - begin, pairs = left.pairs + right.pairs;
    const float area = left.box.half_area(splat(0));
    const float inner = area * rule_.traversal + (left.cost + right.cost);
    const float leaf = area * (rule_.intersection * static_cast<float>(count));
    const bool is_leaf = (count <= rule_.max_leaf_size) & (leaf <= inner);
    next += is_leaf ? 2 * static_cast<ptrdiff_t>(pairs) : -2;
    left.cost = leaf < inner ? leaf : inner;
    left.first = is_leaf ? begin : static_cast<uint32_t>(nodes_end - next);
    left.count = is_leaf ? count : 0;
    left.pairs = is_leaf ? 0 : pairs + 1;
    return next;
  }

  static void store(Node* node, const Subtree& subtree) {
    const Float4 high = -subtree.box.negated_high;
    std::memcpy(&node->min, &subtree.box.low, sizeof(Float4));
    node->first = subtree.first;
    std::memcpy(&node->max, &high, sizeof(Float4));
    node->count = subtree.count;
  }

  const Key* codes_;
  const uint32_t* primitives_;
  const Aabb* boxes_;
  LeafRule rule_;
};

}  // namespace umbel::bvh
