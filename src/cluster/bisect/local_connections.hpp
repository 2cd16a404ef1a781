// The connections among a few items, with their numbers among these: what splits of a block read
// again and again, without the items that lie elsewhere.
#pragma once

#include <cstdint>
#include <vector>

#include "cluster/source.hpp"

namespace umbel::cluster {

struct LocalConnections {
  std::vector<uint32_t> offsets, targets;  ///< between local indices: i is items[i]
  std::vector<uint32_t> local_of;          ///< by item; stale where not of these items

  /// Takes those of the items, in order; `keep(k)` is called with the index of each in the source.
  template <typename Keep>
  void load(const Connections& source, const uint32_t* items, uint32_t count, Keep keep) {
    if (local_of.size() < source.ranges.size()) local_of.resize(source.ranges.size());
    for (uint32_t i = 0; i < count; ++i) local_of[items[i]] = i;
    offsets.assign(1, 0);
    targets.clear();
    for (uint32_t i = 0; i < count; ++i) {
      const Range& range = source.ranges[items[i]];
      for (uint32_t k = range.offset; k < range.offset + range.count; ++k) {
        const uint32_t local = local_of[source.targets[k]];
        if (local >= count || items[local] != source.targets[k] || local == i) continue;
        targets.push_back(local);
        keep(k);
      }
      offsets.push_back(static_cast<uint32_t>(targets.size()));
    }
  }
};

}  // namespace umbel::cluster
