// The radix tree over sorted Morton codes in one pass on a processor: codes are read from the last
// to the first with a stack of finished subtrees, and the two on top become one as soon as they
// have more leading bits in common than the next code has with them (the bottom-up order of
// Apetrei, "Fast and Simple Agglomerative LBVH Construction", 2014, without its atomics). Boxes,
// costs and leaves are done while a subtree is still in the first-level cache.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "base/exec.hpp"
#include "bvh/builders.hpp"
#include "bvh/leaf_rule.hpp"
#include "bvh/tree_parts.hpp"

namespace umbel::bvh {

/// Leading bits that positions i and j > i have in common. Equal codes are told apart by position.
template <typename Key>
UMBEL_HOST_DEVICE inline int common_bits(const Key* codes, uint32_t i, uint32_t j) {
  const Key difference = codes[i] ^ codes[j];
  if (difference != 0) return std::countl_zero(difference);
  return int(sizeof(Key) * 8) + std::countl_zero(i ^ j);
}

/// Where the range [begin, end), of at least two codes, splits: the first position of the right
/// part.
template <typename Key>
UMBEL_HOST_DEVICE inline uint32_t radix_split(const Key* codes, uint32_t begin, uint32_t end) {
  const int common = common_bits(codes, begin, end - 1);
  uint32_t low = begin, high = end - 1;  // low shares more than that with begin, high does not
  while (high - low > 1) {
    const uint32_t middle = low + (high - low) / 2;
    (common_bits(codes, begin, middle) > common ? low : high) = middle;
  }
  return high;
}

/// Builds subtrees over ranges of sorted codes.
template <typename Key>
class MortonStack {
 public:
  MortonStack(const Key* codes, const uint32_t* primitives, const Aabb* boxes, LeafRule rule)
      : codes_(codes), primitives_(primitives), boxes_(boxes), rule_(rule) {}

  /// The range is a subtree of the radix tree. Its nodes are written before `nodes_end`.
  TreePart build(uint32_t begin, uint32_t end, Node* nodes_end) {
    nodes_end_ = next_ = nodes_end;
    size_ = 0;
    int behind = -1;
    for (uint32_t i = end; i-- > begin;) {
      constexpr uint32_t kAhead = 12;
      if (i >= begin + kAhead) __builtin_prefetch(&boxes_[primitives_[i - kAhead]]);
      push_leaf(i, behind);
      const int before = i == begin ? -1 : common_bits(codes_, i - 1, i);
      while (size_ > 1 && stack_[size_ - 1].bits_behind > before) merge();
      behind = before;
    }
    return {stack_[0].node, stack_[0].pairs, nodes_end, 0};
  }

 private:
  struct Entry {
    Node node;
    uint32_t begin, end;  ///< the codes below
    uint32_t pairs;       ///< written for it
    float cost;           ///< while it may still become a leaf
    int bits_behind;      ///< in common with the entry below on the stack
  };

  void push_leaf(uint32_t i, int bits_behind) {
    Entry& leaf = stack_[size_++];
    const Aabb& box = boxes_[primitives_[i]];
    leaf.node = {box.min, i, box.max, 1};
    leaf.begin = i;
    leaf.end = i + 1;
    leaf.pairs = 0;
    leaf.cost = rule_.leaf_cost(box, 1);
    leaf.bits_behind = bits_behind;
  }

  /// The two subtrees on top of the stack become one.
  void merge() {
    Entry& left = stack_[size_ - 1];
    Entry& right = stack_[size_ - 2];
    --size_;
    Aabb box = left.node.box();
    extend(box, right.node.box());
    const uint32_t count = right.end - left.begin;
    if (count <= rule_.max_leaf_size) {
      const float inner = rule_.inner_cost(box, left.cost, right.cost);
      const float leaf = rule_.leaf_cost(box, count);
      right.cost = std::min(inner, leaf);
      if (leaf <= inner) {
        next_ += 2 * size_t(left.pairs + right.pairs);
        right.node = {box.min, left.begin, box.max, count};
        right.begin = left.begin;
        right.pairs = 0;
        return;
      }
    }
    *--next_ = right.node;
    *--next_ = left.node;
    right.node = {box.min, static_cast<uint32_t>(nodes_end_ - next_), box.max, 0};
    right.begin = left.begin;
    right.pairs += left.pairs + 1;
  }

  const Key* codes_;
  const uint32_t* primitives_;
  const Aabb* boxes_;
  LeafRule rule_;
  Node* nodes_end_ = nullptr;
  Node* next_ = nullptr;
  // Bits in common rise towards the top, and there are at most 96 of them.
  Entry stack_[100];
  uint32_t size_ = 0;
};

}  // namespace umbel::bvh
