// The connections that the planes of a grid cut, for nodes that are too large to sweep: the weight
// across each plane is estimated from a sample, and the items next to the plane of choice are
// swept one by one, as a plane seldom lies where the fewest connections are.
#pragma once

#include <cstdint>
#include <vector>

#include "cluster/bisect/cell_bins.hpp"
#include "cluster/bisect/segment.hpp"
#include "cluster/bisect/split_cells.hpp"

namespace umbel::cluster {

class CellConnections {
 public:
  explicit CellConnections(const Segment& segment);
  /// Whether items have any connections.
  bool active() const { return explicit_ || by_vertices_; }

  /// Estimates the weight between the two sides of each plane of a node.
  AtPlanes weigh_planes(const CellSet& set, const Part& part, const CellExtent& extent) const;

  /// The cheapest legal number of items on the left of those near `position` on an axis, where
  /// the sides are connected by `weight`; 0: none is legal.
  uint32_t refine(const CellSet& set, const Part& part, const CellExtent& extent, int axis,
                  uint32_t position, float weight) const;

 private:
  struct Window;

  void rank_items(const Segment& segment);
  void sample_explicit(const CellSet& set, const Part& part, const CellExtent& extent,
                       AtPlanes& change) const;
  void sample_vertices(const CellSet& set, const Part& part, const CellExtent& extent,
                       AtPlanes& change) const;
  bool locate(const CellSet& set, const CellExtent& extent, uint32_t item, Float4& center,
              Int4& layers) const;
  Window window_near(const CellSet& set, const Part& part, const CellExtent& extent, int axis,
                     uint32_t position) const;
  void narrow(const CellSet& set, uint32_t at, Window& window) const;
  float gain(const CellSet& set, const CellExtent& extent, int axis, uint32_t item) const;

  const Source& source_;
  const SplitConstraints& constraints_;
  bool explicit_, by_vertices_;
  uint32_t first_item_ = 0, last_item_ = 0;  ///< of the segment
  /// Of the items from first_item_ on: samples of one in 2^k vertices have one of an item's
  /// vertices if k is at most its rank.
  std::vector<uint8_t> ranks_;
};

}  // namespace umbel::cluster
