// The radix tree over sorted Morton codes in one pass on a processor: codes are read from the last
// to the first with a stack of finished subtrees, and the two on top become one as soon as they
// have more leading bits in common than the next code has with them (the bottom-up order of
// Apetrei, "Fast and Simple Agglomerative LBVH Construction", 2014, without its atomics). Boxes,
// costs and leaves are done while a subtree is still in the first-level cache.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "base/exec.hpp"
#include "bvh/builders.hpp"
#include "bvh/leaf_rule.hpp"

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

/// A finished subtree: its root, and how many pairs of nodes lie below it.
struct MortonSubtree {
  Node root;
  uint32_t pairs;
};

/// Builds subtrees over ranges of sorted codes.
template <typename Key>
class MortonStack {
 public:
  MortonStack(const Key* codes, const uint32_t* primitives, const Aabb* boxes, LeafRule rule)
      : codes_(codes), primitives_(primitives), boxes_(boxes), rule_(rule) {}

  /// The range is a subtree of the radix tree. Nodes are written before `nodes_end`, and an inner
  /// node's `first` is how many nodes before that its children lie.
  MortonSubtree build(uint32_t begin, uint32_t end, Node* nodes_end) {
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
    return {stack_[0].node, stack_[0].pairs};
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

/// An inner node above subtrees: each child is another one behind it in the array, or ~subtree.
struct TopNode {
  uint32_t left, right;
};

/// Makes a tree of subtrees: `ends[i]` is where the nodes of `subtrees[i]` end, `top` is empty for
/// a single one. Nodes come depth-first, the left child first.
inline Bvh2 join_subtrees(std::span<const TopNode> top, std::span<const MortonSubtree> subtrees,
                          std::span<Node* const> ends, std::span<const uint32_t> order) {
  std::vector<MortonSubtree> above(top.size());
  const auto child = [&](uint32_t id) -> const MortonSubtree& {
    return int32_t(id) < 0 ? subtrees[~id] : above[id];
  };
  for (size_t t = top.size(); t-- > 0;) {
    const MortonSubtree &left = child(top[t].left), &right = child(top[t].right);
    Aabb box = left.root.box();
    extend(box, right.root.box());
    above[t] = {{box.min, 0, box.max, 0}, left.pairs + right.pairs + 1};
  }
  Bvh2 tree;
  tree.primitives.assign(order.begin(), order.end());
  tree.nodes = large_vector<Node>(2 * size_t((top.empty() ? subtrees[0] : above[0]).pairs) + 1);

  // Where the pairs below each subtree begin.
  std::vector<uint32_t> bases(subtrees.size(), 1);
  const auto place = [&](uint32_t id, uint32_t base, Node& slot) {
    slot = child(id).root;
    if (int32_t(id) >= 0) {
      above[id].root.first = base;
    } else {
      bases[~id] = base;
    }
    if (!slot.is_leaf()) slot.first = base;
  };
  if (top.empty()) {
    place(~0u, 1, tree.nodes[0]);
  } else {
    place(0, 1, tree.nodes[0]);
  }
  for (const TopNode& node : top) {
    const uint32_t base = above[&node - top.data()].root.first;
    place(node.left, base + 2, tree.nodes[base]);
    place(node.right, base + 2 + 2 * child(node.left).pairs, tree.nodes[base + 1]);
  }
  parallel_for(subtrees.size(), 1, [&](size_t s) {
    const uint32_t count = 2 * subtrees[s].pairs, end = bases[s] + count;
    const Node* from = ends[s] - count;
    const auto sort_leaf = [&](const Node& leaf) {
      uint32_t* primitives = tree.primitives.data() + leaf.first;
      if (leaf.count > 1) std::sort(primitives, primitives + leaf.count);
    };
    if (subtrees[s].root.is_leaf()) sort_leaf(subtrees[s].root);
    for (uint32_t i = 0; i < count; ++i) {
      Node node = from[i];
      if (node.is_leaf()) {
        sort_leaf(node);
      } else {
        node.first = end - node.first;
      }
      tree.nodes[bases[s] + i] = node;
    }
  });
  return tree;
}

}  // namespace umbel::bvh
