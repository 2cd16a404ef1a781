// What an Octree holds, and its nodes as queries see them: a node is gone through as if it were
// three levels of a kd-tree, one plane after the other.
#pragma once

#include "query/cells.hpp"
#include "query/leaf_lists.hpp"
#include "uniform/structure_data.hpp"

namespace umbel {

inline constexpr uint32_t kMaxOctreeDepth = 20;

/// 16 bytes. Bit 0 of a child's number is set above the plane across x, bit 1 above that across y,
/// bit 2 above that across z.
struct OctreeNode {
  union {
    Vec3 middle;  ///< inner: where planes cut the cell
    Range list;   ///< leaf: its references
  };
  uint32_t children;  ///< the first of eight, which follow each other; 0 for a leaf
  bool is_leaf() const { return children == 0; }

  static OctreeNode inner(const Vec3& middle, uint32_t children) {
    OctreeNode node;
    node.middle = middle;
    node.children = children;
    return node;
  }
  static OctreeNode leaf(const Range& list) {
    OctreeNode node;
    node.list = list;
    node.children = 0;
    return node;
  }
};
static_assert(sizeof(OctreeNode) == 16);

/// A node, or those of its children that lie on one side of the planes across the first axes.
struct OctreeName {
  uint32_t node;
  uint16_t axes;   ///< how many planes are decided: 0, 1 or 2
  uint16_t child;  ///< by their bits
  bool operator==(const OctreeName&) const = default;

  OctreeName side(const OctreeNode& of, uint32_t above) const {
    const uint32_t number = child | above << axes;
    if (axes == 2) return {of.children + number, 0, 0};
    return {node, static_cast<uint16_t>(axes + 1), static_cast<uint16_t>(number)};
  }
};

struct OctreeData : UniformData {
  BigVector<OctreeNode> nodes;
};

/// For the queries of query/traverse_leaves.hpp.
class OctreeNodes {
 public:
  static constexpr uint32_t kWidth = 2, kDepth = 3 * kMaxOctreeDepth;
  using Link = CellLink<OctreeName>;
  static constexpr Link kNoLink{{kNone, 0, 0}, {}};

  explicit OctreeNodes(const LeafStore& store)
      : data_(static_cast<const OctreeData&>(store)), error_(cell_error_bound(store)) {}

  Link root() const { return {{0, 0, 0}, data_.bounds}; }
  bool is_leaf(const Link& link) const {
    return link.name.axes == 0 && data_.nodes[link.name.node].is_leaf();
  }
  Link below(const Link& link) const {
    const OctreeNode& node = data_.nodes[link.name.node];
    const uint32_t axis = link.name.axes;
    // The cube may reach beyond the bounds.
    const float plane = std::min(component(link.cell.max, axis), component(node.middle, axis));
    return {link.name.side(node, 0), cell_below(link.cell, axis, plane)};
  }
  Link above(const Link& link) const {
    const OctreeNode& node = data_.nodes[link.name.node];
    const uint32_t axis = link.name.axes;
    const float plane = std::max(component(link.cell.min, axis), component(node.middle, axis));
    return {link.name.side(node, 1), cell_above(link.cell, axis, plane)};
  }
  CellChildren<Link> children(const Link& link) const { return {below(link), above(link), error_}; }
  template <typename Visit>
  void visit_runs(const Link& leaf, const Visit& visit) const {
    visit_links(data_.nodes[leaf.name.node].list, visit);
  }
  bool repeats() const { return true; }

 private:
  const OctreeData& data_;
  Vec3 error_;
};

}  // namespace umbel
