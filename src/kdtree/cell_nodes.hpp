// Cells as the queries of query/traverse_leaves.hpp see nodes: boxes that are computed on the way
// down.
#pragma once

#include "kdtree/split_cost.hpp"
#include "kdtree/tree_data.hpp"
#include "query/ray_frame.hpp"
#include "query/traverse_leaves.hpp"

namespace umbel {

/// By how much cells are made larger on each axis: what was rounded at clipping and at building is
/// far below it, and it is what rays allow for, too (see query/ray_frame.hpp).
inline Vec3 cell_slack(const LeafStore& store) {
  const float furthest = std::max({store.reach[0], store.reach[1], store.reach[2]}) * 0x1p-38f;
  return {store.reach[0] * 0x1p-20f + furthest, store.reach[1] * 0x1p-20f + furthest,
          store.reach[2] * 0x1p-20f + furthest};
}

/// Names a node, or something like one, and has its cell.
template <typename Name>
struct CellLink {
  Name name;
  Aabb cell;
  bool operator==(const CellLink& o) const { return name == o.name; }
};

/// The two parts of a cell.
template <typename Link>
class CellChildren {
 public:
  CellChildren(const Link& first, const Link& second, const Vec3& slack) : links_{first, second} {
    for (uint32_t slot = 0; slot < 2; ++slot) {
      const Aabb& cell = links_[slot].cell;
      const float planes[6] = {cell.min.x - slack.x, cell.max.x + slack.x, cell.min.y - slack.y,
                               cell.max.y + slack.y, cell.min.z - slack.z, cell.max.z + slack.z};
      for (uint32_t i = 0; i < 6; ++i) planes_[2 * i + slot] = planes[i];
    }
  }
  NodeBoxes<2> boxes() const { return {planes_}; }
  const Link& link(uint32_t slot) const { return links_[slot]; }

 private:
  float planes_[14] = {};  ///< two more than there are, as four are loaded at once
  Link links_[2];
};

/// The nodes of a kd-tree.
class KdNodes {
 public:
  static constexpr uint32_t kWidth = 2, kDepth = kMaxKdDepth;
  using Link = CellLink<uint32_t>;
  static constexpr Link kNoLink{kNone, {}};

  explicit KdNodes(const LeafStore& store)
      : data_(static_cast<const KdTreeData&>(store)), slack_(cell_slack(store)) {}

  Link root() const { return {0, data_.bounds}; }
  bool is_leaf(const Link& link) const { return data_.nodes[link.name].is_leaf(); }
  CellChildren<Link> children(const Link& link) const {
    const kdtree::Node& node = data_.nodes[link.name];
    const kdtree::Split split{0, node.at, node.axis(), false};
    return {{link.name + 1, kdtree::cell_below(link.cell, split)},
            {node.above(), kdtree::cell_above(link.cell, split)},
            slack_};
  }
  template <typename Visit>
  void visit_runs(const Link& leaf, const Visit& visit) const {
    visit_links(data_.nodes[leaf.name], visit);
  }
  bool repeats() const { return true; }

 private:
  const KdTreeData& data_;
  Vec3 slack_;
};

}  // namespace umbel
