// The weight of the connections between the two sides of each split of an order.
//
// Explicit connections: each adds its weight where it starts and takes it away where it ends, and
// a prefix sum gives the cost at every position. Shared vertices: a vertex that l of its m items
// in the node have left behind connects l (m - l) pairs; moving one more item across changes that
// by m - 2 l - 1, so no list of neighbours is ever made.
// Ratio cut: Wei and Cheng, "Towards efficient hierarchical designs by ratio cut partitioning",
// ICCAD 1989.
#pragma once

#include <cstdint>
#include <vector>

#include "cluster/bisect/local_connections.hpp"
#include "cluster/source.hpp"
#include "cluster/vertex_table.hpp"

namespace umbel::cluster {

class ConnectionCost {
 public:
  /// Prepares for nodes of these items; local index i is items[i].
  void load(const Source& source, const uint32_t* items, uint32_t count);
  bool active() const { return explicit_ || vertex_weight_ > 0.0f; }

  /// To be called once a node, with the items in any fixed order.
  void enter(const uint32_t* order, uint32_t n);

  /// costs[i - 1] = weight between the first i items of the order and the rest, for 0 < i < n.
  void sweep(const uint32_t* order, uint32_t n, float* costs);

 private:
  void add_explicit(const uint32_t* order, uint32_t n);
  void add_vertices(const uint32_t* order, uint32_t n);

  bool explicit_ = false;
  float vertex_weight_ = 0.0f;
  uint32_t arity_ = 0;
  uint32_t node_ = 0;  ///< number of the node entered last
  LocalConnections connections_;
  std::vector<float> weights_;                ///< by local connection
  std::vector<uint32_t> node_of_, position_;  ///< by local index
  std::vector<double> change_;
  std::vector<uint32_t> vertices_;        ///< local numbers, `arity` an item, kNone: repeated
  std::vector<uint32_t> total_, passed_;  ///< by local vertex
  VertexTable table_;
};

}  // namespace umbel::cluster
