// Bisection of one set of items that fits a cache, depth-first, by one thread.
#pragma once

#include <cstdint>

#include "cluster/bisect/block_items.hpp"
#include "cluster/bisect/block_vertices.hpp"
#include "cluster/bisect/search_splits.hpp"
#include "cluster/bisect/segment.hpp"
#include "cluster/bisect/sweep_splits.hpp"

namespace umbel::cluster {

class Block {
 public:
  void bisect(const Segment& segment);

  /// The same, but halves of large nodes may be bisected at once, by copies: for a caller that has
  /// no other blocks to keep threads busy.
  void bisect_in_parallel(const Segment& segment);

  /// The same in two steps, for a caller that has the boxes at hand: room for `count` boxes
  /// whose tags are the items' indices, then the bisection of what was put there, at any
  /// scale that is a power of two.
  Box4* prepare(uint32_t count) { return items_.prepare(count); }
  void bisect_prepared(const Segment& segment);

 private:
  void gather_components();
  void split_node(uint32_t begin, uint32_t end, uint32_t depth);
  void split_halves(uint32_t begin, uint32_t middle, uint32_t end, uint32_t depth);
  AxisSplit find_split(uint32_t begin, uint32_t end);
  AxisSplit median(uint32_t begin, uint32_t end) const;
  bool is_leaf(uint32_t begin, uint32_t end, int axis, uint32_t vertices = kNone);
  void write_cluster(uint32_t begin, uint32_t end, int axis);

  SplitConstraints constraints_{ClusterConfig{}};  ///< max_items is what vertices will allow
  uint32_t most_items_ = 0;                        ///< the limit that was asked for
  uint32_t* out_items_ = nullptr;
  uint8_t* out_first_ = nullptr;
  uint32_t fork_from_ = kNone;  ///< nodes of as many items are shared with another thread

  BlockItems items_;
  BlockVertices vertices_;
  SplitSearch search_;
  SplitSweep sweep_;
};

}  // namespace umbel::cluster
