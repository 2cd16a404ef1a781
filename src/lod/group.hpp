// Groups of neighbouring clusters, and what they share.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/cluster_set.hpp"
#include "lod/source.hpp"
#include "umbel/cluster.hpp"

namespace umbel::lod {

/// Groups of config.min_group to max_group clusters by bisection, where clusters that share
/// vertices are connected, more strongly by vertices that were locked in the round before: a
/// border that could not be simplified then should lie inside a group now. `locked` is by
/// position id. Scratch is kept from round to round.
class Grouper {
 public:
  explicit Grouper(const Source& source) : source_(source) {}

  /// Whenever the source has got vertices.
  void grow() { owners_.resize(source_.mesh.positions.size(), 0); }

  Clusters group(const ClusterSet& set, std::span<const uint8_t> locked, const Config& config);

  /// Sets locked[p] to 1 for the positions that clusters of two groups use, and to 0 for all
  /// others that clusters use.
  void lock_borders(const ClusterSet& set, const Clusters& groups, std::vector<uint8_t>& locked);

 private:
  const Source& source_;
  std::vector<uint32_t> owners_;  // by position id
};

}  // namespace umbel::lod
