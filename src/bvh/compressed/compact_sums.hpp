// What the layout of compact_tree.hpp needs to know of every merge of a binary tree, found from
// below: leaves by cost (as in Karras & Aila, "Fast parallel construction of high-quality bounding
// volume hierarchies", 2013), and how many nodes of 8 children there would be below a merge if it
// became one. Builders that join subtrees from below find it as they make each merge.
#pragma once

#include "base/exec.hpp"
#include "bvh/tree/merge_tree.hpp"
#include "umbel/compact_bvh.hpp"

namespace umbel::bvh {

/// A merge as one looks at it from above: one load of 16 bytes.
struct alignas(16) CompactBelow {
  Subtree left, right;  ///< those of the merge
  float area;           ///< half of it; kLeaf: cheaper as a leaf; kEven: laid out evenly
  /// If it became a node: nodes with itself, and room for what may have to be evened; times
  /// kHeights, and levels of nodes. Of an even one: where its triangles begin.
  uint32_t packed;

  static constexpr float kLeaf = -1, kEven = -2;
  static constexpr uint32_t kEvenLevel = 10;  ///< of nodes that may be too deep
  static constexpr uint32_t kMostHeight = kMaxCompactDepth - kEvenLevel;
  static constexpr uint32_t kHeights = kMostHeight + 2;  ///< the last one stands for all above

  UMBEL_HOST_DEVICE static CompactBelow leaf() { return {{kNone}, {kNone}, kLeaf, 0}; }
  UMBEL_HOST_DEVICE bool is_leaf() const { return area < 0; }
  UMBEL_HOST_DEVICE uint32_t nodes() const { return packed / kHeights; }
  UMBEL_HOST_DEVICE uint32_t height() const { return packed % kHeights; }
  UMBEL_HOST_DEVICE bool is_tall() const { return height() > kMostHeight; }
};
static_assert(uint64_t{compact_node_capacity(1u << 28)} * CompactBelow::kHeights < 1ull << 32);

/// Subtrees that are too deep are laid out by halving, or rather eighthing, their sequence of
/// items: parts of 8, 64, 512, ... items.
struct EvenSubtree {
  /// The size of each part but the last one, of more than 8 items.
  UMBEL_HOST_DEVICE static uint32_t part(uint32_t items) {
    uint64_t part = 8;
    while (part * 8 < items) part *= 8;
    return static_cast<uint32_t>(part);
  }
  /// Nodes for so many items.
  UMBEL_HOST_DEVICE static uint32_t nodes(uint32_t items) {
    uint32_t sum = 0;
    while (items > 8) {
      const uint32_t each = part(items);
      uint32_t full = 0;
      for (uint32_t size = 8; size < each; size *= 8) full = 8 * full + 1;
      sum += 1 + items / each * full;
      items %= each;
    }
    return sum;
  }
};

/// Merges whose children are done.
struct CompactSums {
  CompactBelow* below;  ///< of each merge
  double* costs;
  const uint32_t* has_area;  ///< whether the root's box has any
  double traversal, intersection;
  uint32_t max_leaf_size;
  uint32_t first = 0;  ///< the merge that the first elements belong to

  /// What is known of a subtree.
  struct Sum {
    double cost;
    CompactBelow below;
  };

  UMBEL_HOST_DEVICE static double area(const Aabb& b) {
    const double x = double(b.max.x) - double(b.min.x), y = double(b.max.y) - double(b.min.y),
                 z = double(b.max.z) - double(b.min.z);
    return x * y + y * z + z * x;
  }
  /// Without area a line meets every node or none.
  UMBEL_HOST_DEVICE double weight(const Aabb& box) const {
    const double own = area(box);
    return own > 0 || *has_area ? own : 1;
  }
  /// The box counts for primitives only.
  UMBEL_HOST_DEVICE Sum of(Subtree s, const Aabb& box) const {
    if (s.is_primitive()) return {weight(box) * intersection, CompactBelow::leaf()};
    return {costs[s.index() - first], below[s.index() - first]};
  }
  UMBEL_HOST_DEVICE Sum join(uint32_t id, const Merge& merge, const Sum& left,
                             const Sum& right) const {
    const double whole = weight(merge.box);
    const double split = whole * traversal + left.cost + right.cost;
    const double leaf = whole * intersection * merge.count;
    Sum sum{leaf, {merge.left, merge.right, CompactBelow::kLeaf, 0}};
    if (merge.count > max_leaf_size || !(leaf <= split)) {
      sum.cost = split;
      sum.below.area = area_of(merge.box);
      sum.below.packed = node_over(merge.count, left.below, right.below);
    }
    costs[id - first] = sum.cost;
    below[id - first] = sum.below;
    return sum;
  }

  /// As those of NoMergeSums.
  template <uint32_t kMerges>
  struct Shared {
    CompactBelow below[kMerges];
    double costs[kMerges];
  };
  template <uint32_t kMerges>
  UMBEL_HOST_DEVICE CompactSums within(Shared<kMerges>& shared, uint32_t first_merge) const {
    CompactSums own = *this;
    own.below = shared.below;
    own.costs = shared.costs;
    own.first = first_merge;
    return own;
  }
  template <typename Team, typename Take>
  UMBEL_HOST_DEVICE void copy_to(const Team& team, uint32_t count, const Take& take,
                                 const CompactSums& all) const {
    for (uint32_t i = team.rank(); i < count; i += team.size()) {
      if (!take(i)) continue;
      all.below[first + i] = below[i];
      all.costs[first + i] = costs[i];
    }
  }

  UMBEL_HOST_DEVICE CompactBelow look(Subtree s) const {
    return s.is_primitive() ? CompactBelow::leaf() : below[s.index() - first];
  }
  /// Makes the first two of up to 8 children the children of a node, by opening the one with the
  /// largest area again and again (Wald, Benthin & Boulos, "Getting Rid of Packets", 2008). Returns
  /// how many there are. Written without an index that is not a constant once loops are unrolled,
  /// so that all stays in registers.
  UMBEL_HOST_DEVICE uint32_t open(Subtree ids[8], CompactBelow children[8]) const {
    uint32_t count = 2;
    UMBEL_UNROLL
    for (uint32_t next = 2; next < 8; ++next) {
      uint32_t largest = 0;
      CompactBelow opened = children[0];
      UMBEL_UNROLL
      for (uint32_t i = 1; i < next; ++i) {
        if (!(children[i].area > opened.area)) continue;
        largest = i;
        opened = children[i];
      }
      if (!(opened.area >= 0)) break;
      const CompactBelow left = look(opened.left);
      UMBEL_UNROLL
      for (uint32_t i = 0; i < next; ++i) {
        if (i != largest) continue;
        ids[i] = opened.left;
        children[i] = left;
      }
      ids[next] = opened.right;
      children[next] = look(opened.right);
      count = next + 1;
    }
    return count;
  }

 private:
  /// `packed` of a merge of so many primitives, from its children.
  UMBEL_HOST_DEVICE uint32_t node_over(uint32_t primitives, const CompactBelow& left,
                                       const CompactBelow& right) const {
    Subtree ids[8];
    CompactBelow children[8] = {left, right};
    for (uint32_t i = 2; i < 8; ++i) children[i] = CompactBelow::leaf();
    open(ids, children);
    uint32_t nodes = 1, height = 0;
    UMBEL_UNROLL
    for (uint32_t i = 0; i < 8; ++i) {
      // A leaf has neither.
      const uint32_t below_it = children[i].height();
      nodes += children[i].nodes();
      if (!children[i].is_leaf() && below_it > height) height = below_it;
    }
    if (height <= CompactBelow::kMostHeight) ++height;
    if (height > CompactBelow::kMostHeight) {
      const uint32_t even = EvenSubtree::nodes(primitives);
      if (even > nodes) nodes = even;
    }
    return nodes * CompactBelow::kHeights + height;
  }
};

/// The memory of sums.
template <typename Exec>
class CompactSumArrays {
 public:
  CompactSumArrays(Exec& exec, uint32_t merges) {
    below_ = exec.template allocate<CompactBelow>(merges);
    costs_ = exec.template allocate<double>(merges);
  }
  /// *has_area is set before anything is summed up.
  CompactSums sums(const uint32_t* has_area, const CostModel& cost, uint32_t max_leaf_size) const {
    return {below_.data(),  costs_.data(),     has_area,
            cost.traversal, cost.intersection, max_leaf_size};
  }

 private:
  typename Exec::template Buffer<CompactBelow> below_;
  typename Exec::template Buffer<double> costs_;
};

}  // namespace umbel::bvh
