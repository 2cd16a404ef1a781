// The items of a block: their boxes, and their order by centroid along each axis. Splits keep the
// three orders sorted by stable partition.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/simd/box4.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {

struct AxisSplit {
  float cost;
  uint32_t position = 0;  ///< items on the left; 0: none found
  int axis = 0;
  uint32_t left_vertices = kNone, right_vertices = kNone;  ///< of the sides, where they are known
};

/// Items are named by local indices, from 0 on in the order in which they came.
class BlockItems {
 public:
  /// Room for `count` boxes whose tags are the items' indices in the source, to be filled before
  /// `find_centers`, at any scale that is a power of two.
  Box4* prepare(uint32_t count);
  /// The centroids of the source, or else the boxes' centres.
  void find_centers(const Source& source);
  /// Moves centres by this share of the way to the middle of their component, so that fewer splits
  /// go through it. Of each component, `firsts` has the same item for all.
  void gather(std::span<const uint32_t> firsts, float share);
  /// Sorts by the centres.
  void sort();

  uint32_t count() const { return count_; }
  const Box4* boxes() const { return boxes_.data(); }
  /// In the source.
  uint32_t item(uint32_t local) const { return boxes_[local].tag(); }
  const uint32_t* order(int axis) const { return orders_[axis].data(); }

  /// Of the items [begin, end) of the orders, which are the same ones on every axis.
  Box4 bounds(uint32_t begin, uint32_t end) const;
  /// Scales the boxes of a node up if they are tiny, where a split has parted it from something far
  /// away. Returns the padding that suits the node.
  Float4 normalise(uint32_t begin, uint32_t end, const Box4& bounds);
  /// Moves the left items of each order to its front.
  void partition(uint32_t begin, uint32_t end, const AxisSplit& split);

 private:
  void sort_axis(int axis);
  void settle_ties(int axis);
  void sort_exactly(int axis);

  uint32_t count_ = 0;
  std::vector<Box4> boxes_;
  std::array<std::vector<float>, 3> centers_;
  Float4 lowest_{}, highest_{};   ///< centre an axis
  std::vector<Box4> components_;  ///< bounds of the centres, by the first item of a component
  std::array<std::vector<uint32_t>, 3> orders_;
  std::vector<uint32_t> spare_;
  std::vector<uint8_t> right_;  ///< by local index: on the right of the split
  std::vector<uint32_t> words_;
  std::vector<uint64_t> long_words_, spare_long_words_;
};

}  // namespace umbel::cluster
