// The cheapest split of a node of micro-clusters.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "cluster/bisect/micro_clusters.hpp"
#include "cluster/bisect/split_constraints.hpp"

namespace umbel::cluster {

/// The bins that centres fall into, on three axes at once.
struct BinMapping {
  UShort8 origin{}, multiplier{}, factor{};
  UShort8 of(ShortBox box) const {
    return multiply_high((center_of(box) - origin) * multiplier, factor);
  }
  uint32_t of(const ShortBox& box, int axis) const {
    const uint16_t offset = center_of(box, axis) - origin[axis];
    return uint32_t(uint16_t(uint32_t(offset) * multiplier[axis])) * factor[axis] >> 16;
  }
};

struct Choice {
  int axis = -1;          ///< -1: none
  uint32_t bin = 0;       ///< all bins below it are on the left
  uint32_t before = 0;    ///< items in those
  uint32_t position = 0;  ///< items on the left: `before`, or more: a split within the bin
  BinMapping mapping;
};

class MicroClusterBins {
 public:
  explicit MicroClusterBins(const SplitConstraints& constraints);

  /// Splits `count` items in micro-clusters [begin, end), whose centres fill `centers`.
  Choice cheapest(const MicroCluster* begin, const MicroCluster* end, uint32_t count,
                  ShortBox centers) const;

 private:
  static constexpr uint32_t kMost = 32;
  static constexpr uint32_t kTabled = 1 << 12;  ///< weights of fewer items are looked up

  struct Bins {
    uint32_t count;  ///< a axis
    ShortBox boxes[3][kMost];
    uint32_t counts[3][kMost];
  };

  void weigh(const Bins& bins, int axis, uint32_t count, Choice& best, float& best_cost) const;
  uint32_t whole(uint32_t n) const {
    return n < kTabled ? whole_[n] : n - n % constraints_.config.max_items;
  }

  const SplitConstraints& constraints_;
  std::vector<float> weights_, last_weights_;  ///< in large nodes, and in those near the leaves
  std::vector<uint32_t> whole_;                ///< items in full clusters
};

}  // namespace umbel::cluster
