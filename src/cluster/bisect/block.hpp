// Bisection of one set of items that fits a cache, depth-first, by one thread.
//
// Items are sorted once an axis by centroid; splits keep the three orders sorted by stable
// partition. Every legal position of every axis is a candidate, but few are looked at: areas grow
// along an order, so the cost of all positions between two others has a lower bound, and only
// where that is below the best cost known is it worth to sweep item by item (search_splits.cpp).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/simd/box_record.hpp"
#include "cluster/bisect/connection_cost.hpp"
#include "cluster/bisect/shared_bits.hpp"
#include "cluster/bisect/split_constraints.hpp"
#include "cluster/source.hpp"
#include "cluster/vertex_table.hpp"

namespace umbel::cluster {

class Block {
 public:
  /// Rearranges items[0, count) into cluster order and sets first[i] to 1 where a cluster
  /// starts, 0 elsewhere.
  void bisect(const Source& source, const SplitConstraints& constraints, uint32_t* items,
              uint8_t* first, uint32_t count);

  /// The same, but halves of large nodes may be bisected at once, by copies: for a caller that has
  /// no other blocks to keep threads busy.
  void bisect_in_parallel(const Source& source, const SplitConstraints& constraints,
                          uint32_t* items, uint8_t* first, uint32_t count);

  /// The same in two steps, for a caller that has the boxes at hand: room for `count` boxes
  /// whose tags are the items' indices, then the bisection of what was put there, at any
  /// scale that is a power of two.
  BoxRecord* prepare(const Source& source, const SplitConstraints& constraints, uint32_t count);
  void bisect_prepared(uint32_t* items, uint8_t* first);

 private:
  struct Split {
    float cost;
    uint32_t position = 0;  ///< items on the left; 0: none found
    int axis = 0;
  };
  struct Gap {  ///< the positions between two chunk borders of an axis
    float bound;
    int axis;
    uint32_t chunk;
  };

  void find_centers();
  void sort_axis(int axis);
  void settle_ties(int axis);
  void sort_exactly(int axis);
  void split(uint32_t begin, uint32_t end, uint32_t depth);
  void expect_vertices();
  void split_node(uint32_t begin, uint32_t end, uint32_t depth);
  void split_halves(uint32_t begin, uint32_t middle, uint32_t end, uint32_t depth);
  bool is_leaf(uint32_t begin, uint32_t end, int axis);
  void make_leaf(uint32_t begin, uint32_t end, int axis);
  BoxRecord bounds(uint32_t begin, uint32_t end) const;
  void normalise(uint32_t begin, uint32_t end, const BoxRecord& bounds);
  Split median(uint32_t begin, uint32_t end) const;
  void partition(uint32_t begin, uint32_t end, const Split& split);

  // search_splits.cpp
  Split cheapest(uint32_t begin, uint32_t end);
  uint32_t chunk_size(uint32_t n) const;
  BoxRecord reduce_chunks(uint32_t begin, uint32_t n, uint32_t step);
  void weigh_borders(uint32_t n, uint32_t step, Split& best);
  void list_gaps(uint32_t n, uint32_t step, const Split& best);
  void search_gap(uint32_t begin, uint32_t n, uint32_t step, const Gap& gap, Split& best);
  void fill_weights(uint32_t n);

  // sweep_splits.cpp
  Split cheapest_by_sweep(uint32_t begin, uint32_t end);
  void sweep(uint32_t begin, uint32_t end, int axis, bool vertex_bound, Split& best);
  void add_overlap(const uint32_t* order, uint32_t n);
  void weigh_vertices(const uint32_t* order, uint32_t n);
  uint32_t count_vertices(uint32_t begin, uint32_t end, int axis);
  void number_vertices(uint32_t begin, uint32_t end);

  const Source* source_ = nullptr;
  SplitConstraints constraints_{
      ClusterConfig{}};      ///< max_items is what vertices will let a cluster have
  uint32_t most_items_ = 0;  ///< the limit that was asked for
  uint32_t* items_ = nullptr;
  uint8_t* first_ = nullptr;
  uint32_t count_ = 0;
  uint32_t fork_from_ = kNone;  ///< nodes of as many items are shared with another thread
  Float4 pad_{};                ///< of the node at hand

  std::vector<BoxRecord> boxes_;  ///< by local index; the tag is the item
  std::array<std::vector<float>, 3> centers_;
  Float4 lowest_{}, highest_{};  ///< centre an axis
  std::array<std::vector<uint32_t>, 3> orders_;
  std::vector<uint32_t> spare_;
  std::vector<uint8_t> right_;  ///< by local index: on the right of the split
  std::vector<uint32_t> words_;
  std::vector<uint64_t> long_words_, spare_long_words_;

  // By chunk border: the boxes of all before and of all after, and their areas.
  std::array<std::vector<BoxRecord>, 3> before_, after_;
  std::array<std::vector<float>, 3> area_before_, area_after_;
  std::vector<float> gap_areas_;
  std::vector<Gap> gaps_;
  struct Weights {  ///< SplitConstraints::weight(i)
    std::vector<float> of;
    uint32_t max_items = 0;
    float underfill_cost = -1.0f;
  };
  std::array<Weights, 2> weights_;       ///< for large nodes, and for those near the leaves
  const float* node_weights_ = nullptr;  ///< for the node at hand

  std::vector<float> left_area_, right_area_, extra_, left_weight_, right_weight_;
  std::vector<BoxRecord> left_boxes_;
  VertexTable table_;
  QuickVertexCount quick_count_;
  std::vector<uint32_t> numbers_;  ///< of the vertices of a vertex-bound node
  std::vector<uint8_t> seen_;
  uint32_t node_vertices_ = 0;  ///< of the same node
  ConnectionCost connection_cost_;
  SharedBits shared_;
};

}  // namespace umbel::cluster
