// What an IntervalHierarchy holds, and its nodes as queries see them.
#pragma once

#include "query/cells.hpp"
#include "query/leaf_lists.hpp"
#include "uniform/structure_data.hpp"

namespace umbel {

/// Deepest leaf: halvings of space, and then of what is left by number.
inline constexpr uint32_t kMaxHalvings = 44, kMaxIntervalDepth = kMaxHalvings + 30;

/// 12 bytes, depth-first: the child below follows its parent.
struct IntervalNode {
  union {
    float below_max;  ///< inner: the child below ends here
    uint32_t first;   ///< leaf: offset of its references
  };
  union {
    float above_min;  ///< inner: the child above begins here
    uint32_t count;   ///< leaf: how many references
  };
  uint32_t link;  ///< lowest 2 bits: the axis, or 3 for a leaf; the others: how far behind this
                  ///< node the child above is
  bool is_leaf() const { return (link & 3) == 3; }
  uint32_t axis() const { return link & 3; }
  uint32_t above() const { return link >> 2; }
  Range list() const { return {first, count}; }  ///< of a leaf, its references
};
static_assert(sizeof(IntervalNode) == 12);

struct IntervalData : UniformData {
  BigVector<IntervalNode> nodes;
};

/// For the queries of query/traverse_leaves.hpp.
class IntervalNodes {
 public:
  static constexpr uint32_t kWidth = 2, kDepth = kMaxIntervalDepth;
  using Link = CellLink<uint32_t>;
  static constexpr Link kNoLink{kNone, {}};

  explicit IntervalNodes(const LeafStore& store)
      : data_(static_cast<const IntervalData&>(store)), error_(cell_error_bound(store)) {}

  Link root() const { return {0, data_.bounds}; }
  bool is_leaf(const Link& link) const { return data_.nodes[link.name].is_leaf(); }
  Link below(const Link& link) const {
    const IntervalNode& node = data_.nodes[link.name];
    Aabb cell = link.cell;
    float& high = component(cell.max, node.axis());
    high = std::min(high, node.below_max);
    return {link.name + 1, cell};
  }
  Link above(const Link& link) const {
    const IntervalNode& node = data_.nodes[link.name];
    Aabb cell = link.cell;
    float& low = component(cell.min, node.axis());
    low = std::max(low, node.above_min);
    return {link.name + node.above(), cell};
  }
  CellChildren<Link> children(const Link& link) const { return {below(link), above(link), error_}; }
  template <typename Visit>
  void visit_runs(const Link& leaf, const Visit& visit) const {
    visit_links(data_.nodes[leaf.name].list(), visit);
  }
  bool repeats() const { return false; }

 private:
  const IntervalData& data_;
  Vec3 error_;
};

}  // namespace umbel
