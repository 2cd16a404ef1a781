// The cheapest split of a node by a full sweep of the three orders, for nodes whose cost is more
// than areas: overlap, connections between the sides, or too many vertices for a leaf.
#pragma once

#include <array>
#include <cmath>
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

  /// Splits the items [begin, end) of the orders. With `vertices`, both sides are weighed by how
  /// many clusters of at most `most_items` their vertices allow, rather than by their items alone.
  AxisSplit cheapest(BlockItems& items, BlockVertices* vertices,
                     const SplitConstraints& constraints, uint32_t most_items, uint32_t begin,
                     uint32_t end);

 private:
  struct Node {
    const BlockItems& items;
    const SplitConstraints& constraints;
    uint32_t most_items;
    uint32_t n;
    Float4 pad;
  };
  /// The clusters that vertices make, with the duplicates along the cuts between them.
  struct ClustersOfVertices {
    float limit;   ///< of one cluster
    float usable;  ///< of these, in whole items
    float lost;    ///< by the border of one that others surround

    float capacity(float clusters) const {
      return clusters * usable - lost * (clusters - std::sqrt(clusters));
    }
  };
  /// The least clusters that hold so many items and vertices, which only grow along an order.
  struct ClustersNeeded {
    const ClustersOfVertices& of;
    float most_items;
    float clusters = 1.0f, capacity = of.capacity(1.0f);

    void grow_to(float items, float vertices);
  };

  void sweep(const Node& node, const uint32_t* order, Box4& all);
  void add_connections(const Node& node, const uint32_t* order, const Box4& all);
  void add_overlap(const Node& node, const uint32_t* order);
  void weigh_items(const Node& node);
  void count_vertices(const Node& node, uint32_t begin, BlockVertices& vertices);
  ClustersOfVertices clusters_of_vertices(const Node& node, uint32_t node_vertices) const;
  void weigh_vertices(const Node& node, int axis, uint32_t node_vertices,
                      const ClustersOfVertices& clusters, uint32_t least);

  ConnectionCost connections_;
  // By position, less one: of the sides, and what is added to their cost.
  std::vector<float> left_area_, right_area_, extra_, left_weight_, right_weight_;
  std::array<std::vector<uint32_t>, 3> left_vertices_, right_vertices_;  ///< an axis
  std::vector<Box4> left_boxes_;
};

}  // namespace umbel::cluster
