// The nodes of a kd-tree as the queries of query/traverse_leaves.hpp see them.
#pragma once

#include "kdtree/tree_data.hpp"
#include "query/cells.hpp"
#include "query/leaf_lists.hpp"

namespace umbel {

class KdNodes {
 public:
  static constexpr uint32_t kWidth = 2, kDepth = kMaxKdDepth;
  using Link = CellLink<uint32_t>;
  static constexpr Link kNoLink{kNone, {}};

  explicit KdNodes(const LeafStore& store)
      : data_(static_cast<const KdTreeData&>(store)), error_(cell_error_bound(store)) {}

  Link root() const { return {0, data_.bounds}; }
  bool is_leaf(const Link& link) const { return data_.nodes[link.name].is_leaf(); }
  CellChildren<Link> children(const Link& link) const {
    const kdtree::Node& node = data_.nodes[link.name];
    return {{link.name + 1, cell_below(link.cell, node.axis(), node.at)},
            {node.above(), cell_above(link.cell, node.axis(), node.at)},
            error_};
  }
  template <typename Visit>
  void visit_runs(const Link& leaf, const Visit& visit) const {
    visit_links(data_.nodes[leaf.name].list(), visit);
  }
  bool repeats() const { return true; }

 private:
  const KdTreeData& data_;
  Vec3 error_;
};

}  // namespace umbel
