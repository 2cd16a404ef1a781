// The cheapest split of a node by the surface area heuristic, exactly, without sweeping every item.
//
// Every legal position of every axis is a candidate, but few are evaluated. The items of an order
// are taken in chunks, at whose borders the boxes before and after, and so the cost, are known.
// Before a position inside a chunk lies at least what lies before the chunk, and after it at least
// what lies after; item weights grow with their number. That bounds the cost from below, and only
// chunks whose bound is below the best cost are swept.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cluster/bisect/block_items.hpp"
#include "cluster/bisect/split_constraints.hpp"

namespace umbel::cluster {

class SplitSearch {
 public:
  /// Splits the items [begin, end) of the orders.
  AxisSplit cheapest(BlockItems& items, const SplitConstraints& constraints, uint32_t begin,
                     uint32_t end);

 private:
  struct Node {
    const BlockItems& items;
    const SplitConstraints& constraints;
    uint32_t begin, n;
    uint32_t step;         ///< items of a chunk
    const float* weights;  ///< of so many items: SplitConstraints::weight
    Float4 pad;

    uint32_t chunks() const { return (n + step - 1) / step; }
  };
  struct Gap {  ///< the positions between two chunk borders of an axis
    float bound;
    int axis;
    uint32_t chunk;
  };
  struct Weights {
    std::vector<float> of;
    uint32_t max_items = 0;
    float underfill_cost = -1.0f;
  };

  Box4 reduce_chunks(const Node& node);
  void evaluate_borders(const Node& node, AxisSplit& best);
  void list_gaps(const Node& node, const AxisSplit& best);
  void search_gap(const Node& node, const Gap& gap, AxisSplit& best);
  const float* fill_weights(const SplitConstraints& constraints, uint32_t n);

  // By chunk border: the boxes of all before and of all after, and their areas.
  std::array<std::vector<Box4>, 3> before_, after_;
  std::array<std::vector<float>, 3> area_before_, area_after_;
  std::vector<float> gap_areas_;
  std::vector<Gap> gaps_;
  std::array<Weights, 2> weights_;  ///< for large nodes, and for those near the leaves
};

}  // namespace umbel::cluster
