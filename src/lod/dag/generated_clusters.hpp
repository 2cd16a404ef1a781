// Clusters by the group that generated them: those that take its place in coarser cuts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "umbel/lod/types.hpp"

namespace umbel::lod {

class GeneratedClusters {
 public:
  explicit GeneratedClusters(const Tables& tables) : offsets_(tables.groups.size() + 1, 0) {
    for (const Cluster& cluster : tables.clusters)
      if (cluster.generating_group != kNone) ++offsets_[cluster.generating_group + 1];
    for (size_t g = 1; g < offsets_.size(); ++g) offsets_[g] += offsets_[g - 1];
    clusters_.resize(offsets_.back());
    std::vector<uint32_t> next(offsets_.begin(), offsets_.end() - 1);
    for (uint32_t c = 0; c < tables.clusters.size(); ++c)
      if (const uint32_t g = tables.clusters[c].generating_group; g != kNone)
        clusters_[next[g]++] = c;
  }

  std::span<const uint32_t> of(uint32_t group) const {
    return {clusters_.data() + offsets_[group], offsets_[group + 1] - offsets_[group]};
  }

 private:
  std::vector<uint32_t> offsets_, clusters_;
};

}  // namespace umbel::lod
