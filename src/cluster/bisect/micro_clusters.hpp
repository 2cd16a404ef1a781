// Micro-clusters: a few neighbouring items each, that stand for single items while large nodes are
// split.
#pragma once

#include <vector>

#include "base/huge_array.hpp"
#include "base/simd/small_box.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {

/// A micro-cluster, or a group of them.
struct alignas(32) Micro {
  SmallBox box;
  union {
    SmallBox* items;     ///< of a micro-cluster: boxes, whose tags are the items
    const Micro* parts;  ///< of a group
  };
  uint32_t count;       ///< items
  uint32_t part_count;  ///< of a group
};

struct MicroSet {
  explicit MicroSet(uint32_t count) : boxes(count), sorted(count) {}
  HugeArray<SmallBox> boxes, sorted;
  std::vector<std::vector<Micro>> micros;
  std::vector<Micro> groups;  ///< along a Morton curve
  std::vector<Micro> crowds;  ///< as many items as a cluster takes, or more, at one rounded centre
};

/// Whether coordinates within these bounds can be rounded to small boxes.
bool suits_small_boxes(const BoxRecord& bounds);

struct MicroSizes {
  uint32_t micro;  ///< most items of a micro-cluster, unless their rounded centres are the same
  uint32_t group;  ///< most items of a group, likewise
  uint32_t crowd;  ///< least items of a crowd
};

/// `bounds` holds all items; the result does not depend on how much more it holds. Empty if the
/// items fill too little or too much room.
MicroSet make_micros(const Source& source, const uint32_t* items, uint32_t count,
                     const BoxRecord& bounds, const MicroSizes& sizes);

/// The box of all items.
BoxRecord box_of(const Source& source, const uint32_t* items, uint32_t count);

}  // namespace umbel::cluster
