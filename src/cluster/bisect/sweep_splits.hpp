// The cheapest split of a node by a full sweep of the three orders, for nodes whose cost is more
// than areas: overlap, connections between the sides, or too many vertices for a leaf.
#pragma once

#include <cstdint>
#include <vector>

#include "cluster/bisect/block_items.hpp"
#include "cluster/bisect/block_vertices.hpp"
#include "cluster/bisect/connection_cost.hpp"
#include "cluster/bisect/split_constraints.hpp"

namespace umbel::cluster {

class SplitSweep {
 public:
  /// Prepares for nodes of these items; local index i is items[i].
  void load(const Source& source, const uint32_t* items, uint32_t count) {
    connections_.load(source, items, count);
  }
  bool has_connections() const { return connections_.active(); }

  /// Splits the items [begin, end) of the orders. `by_vertices`: so that both sides have as many
  /// items as their vertices allow, rather than by the items that full clusters lack.
  AxisSplit cheapest(BlockItems& items, BlockVertices& vertices,
                     const SplitConstraints& constraints, uint32_t begin, uint32_t end,
                     bool by_vertices);

 private:
  struct Node {
    const BlockItems& items;
    const SplitConstraints& constraints;
    uint32_t n;
    Float4 pad;
  };

  void sweep(const Node& node, const uint32_t* order, Box4& all);
  void add_connections(const Node& node, const uint32_t* order, const Box4& all);
  void add_overlap(const Node& node, const uint32_t* order);
  void weigh_items(const Node& node);
  void weigh_vertices(const Node& node, const uint32_t* order, BlockVertices& vertices);

  ConnectionCost connections_;
  // By position, less one: of the sides, and what is added to their cost.
  std::vector<float> left_area_, right_area_, extra_, left_weight_, right_weight_;
  std::vector<Box4> left_boxes_;
};

}  // namespace umbel::cluster
