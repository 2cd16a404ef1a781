// MicroCluster-clusters: a few neighbouring items each, that stand for single items while large
// nodes are split.
#pragma once

#include <vector>

#include "base/cpu_buffer.hpp"
#include "base/simd/short_box.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {

/// A micro-cluster, or a group of them.
struct alignas(32) MicroCluster {
  ShortBox box;
  union {
    ShortBox* items;            ///< of a micro-cluster: boxes, whose tags are the items
    const MicroCluster* parts;  ///< of a group
  };
  uint32_t count;       ///< items
  uint32_t part_count;  ///< of a group
};

struct MicroClusterSet {
  explicit MicroClusterSet(uint32_t count) : boxes(count), sorted(count) {}
  CpuBuffer<ShortBox> boxes, sorted;
  std::vector<std::vector<MicroCluster>> micros;
  std::vector<MicroCluster> groups;  ///< along a Morton curve
  /// Sets of coincident items: a cluster's items or more that have one rounded centre.
  std::vector<MicroCluster> coincident;
};

/// Whether coordinates within these bounds can be rounded to short boxes.
bool suits_short_boxes(const Box4& bounds);

struct MicroClusterSizes {
  uint32_t micro;  ///< most items of a micro-cluster, unless their rounded centres are the same
  uint32_t group;  ///< most items of a group, likewise
  uint32_t coincident;  ///< fewest items of a set of coincident ones
};

/// `bounds` holds all items; the result does not depend on how much more it holds. Empty if the
/// items fill too little or too much room.
MicroClusterSet make_micro_clusters(const Source& source, const uint32_t* items, uint32_t count,
                                    const Box4& bounds, const MicroClusterSizes& sizes);

/// The box of all items.
Box4 box_of(const Source& source, const uint32_t* items, uint32_t count);

}  // namespace umbel::cluster
