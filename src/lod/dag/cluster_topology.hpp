// Non-manifold edges of a mesh in clusters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/cluster_set.hpp"
#include "lod/dag/topology.hpp"

namespace umbel::lod {

struct ClusterTopology {
  std::vector<uint32_t> non_manifold_components;  ///< see topology.hpp
  size_t degenerate_triangles = 0;
  /// All directed edges between two frozen positions.
  std::vector<PositionPair> undecided;
};

/// The vertices of `clusters` are indices into `position_ids`. `frozen` are positions that have
/// triangles elsewhere: edges between two of them count for nothing here.
ClusterTopology cluster_topology(const ClusterSet& clusters, std::span<const uint32_t> position_ids,
                                 std::span<const uint32_t> frozen = {});

}  // namespace umbel::lod
