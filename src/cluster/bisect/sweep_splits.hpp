// The cheapest split of a node by a full sweep of the three orders, for nodes whose cost is more
// than areas: overlap, connections between the sides, or too many vertices for a leaf.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/simd/float4.hpp"
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
  /// What a side weighs by the clusters that its items and vertices need.
  class VertexWeights {
   public:
    void reset(const Node& node, const ClustersOfVertices& clusters, uint32_t node_vertices);
    float operator()(uint32_t items, uint32_t vertices) const;
    /// What vertices of both sides add to each, as if they were as many more items.
    float of_doubled(uint32_t left, uint32_t right) const {
      return items_per_vertex_ * (static_cast<float>(left + right) - node_vertices_);
    }
    Float4 of_doubled(Float4 left, Float4 right) const {
      return splat(items_per_vertex_) * (left + right - splat(node_vertices_));
    }
    /// At most that, and the same unless the vertices need more clusters than the items.
    Float4 least(Float4 of_items, Float4 capacities, Float4 vertices) const {
      return of_items + splat(vertex_price_) * max4(capacities - vertices, splat(0.0f));
    }
    /// Of so many items and one, two and three more.
    Float4 items(uint32_t count) const { return load4(&items_[kPadding + count]); }
    Float4 capacities(uint32_t count) const { return load4(&capacities_[kPadding + count]); }
    /// Of so many items and one, two and three less.
    Float4 items_down(uint32_t count) const { return reversed(&items_[kPadding + count - 3]); }
    Float4 capacities_down(uint32_t count) const {
      return reversed(&capacities_[kPadding + count - 3]);
    }

   private:
    static constexpr uint32_t kPadding = 4;
    static Float4 reversed(const float* p) {
      const Float4 v = load4(p);
      return __builtin_shufflevector(v, v, 3, 2, 1, 0);
    }

    ClustersOfVertices clusters_{};
    float node_vertices_ = 0, items_per_vertex_ = 0;
    float most_ = 0, full_ = 0, item_price_ = 0, vertex_price_ = 0;
    // Of 0, 1, 2, ... items, with padding at both ends: what they weigh without their vertices, and
    // the capacity of the clusters that they need.
    std::vector<float> items_, capacities_;
  };

  void sweep(const Node& node, const uint32_t* order, Box4& all);
  void add_connections(const Node& node, const uint32_t* order, const Box4& all);
  void add_overlap(const Node& node, const uint32_t* order);
  void weigh_items(const Node& node);
  void count_vertices(const Node& node, uint32_t begin, BlockVertices& vertices);
  ClustersOfVertices clusters_of_vertices(const Node& node, uint32_t node_vertices) const;
  void bound_costs(const Node& node, int axis);
  void search_by_vertices(const Node& node, int axis, uint32_t least, AxisSplit& best);

  ConnectionCost connections_;
  // By position, less one: of the sides, and what is added to their cost.
  std::vector<float> left_area_, right_area_, extra_, left_weight_, right_weight_;
  std::vector<float> bounds_;  ///< of the cost, from below
  std::array<std::vector<uint32_t>, 3> left_vertices_, right_vertices_;  ///< an axis
  VertexWeights weights_;
  std::vector<Box4> left_boxes_;
};

}  // namespace umbel::cluster
