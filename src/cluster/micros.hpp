// Micro-clusters: a few neighbouring items each, that stand for single items while large nodes are
// split.
#pragma once

#include <vector>

#include "cluster/small_box.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {

struct alignas(32) Micro {
  SmallBox box;
  uint32_t begin, count;  ///< in MicroSet::order
};

struct MicroSet {
  std::vector<uint32_t> order;  ///< items by micro-cluster
  std::vector<Micro> micros;    ///< along a Morton curve
};

/// Whether coordinates within these bounds can be rounded to small boxes.
bool suits_small_boxes(const BoxRecord& bounds);

/// Groups of at most `most` items, except that items with the same rounded centre stay together.
MicroSet make_micros(const Source& source, const uint32_t* items, uint32_t count,
                     const BoxRecord& bounds, uint32_t most);

/// The box of all items.
BoxRecord box_of(const Source& source, const uint32_t* items, uint32_t count);

}  // namespace umbel::cluster
