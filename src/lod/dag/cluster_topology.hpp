// Non-manifold edges of a mesh in clusters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/cluster_set.hpp"

namespace umbel::lod {

struct ClusterTopology {
  std::vector<uint32_t> non_manifold_components;  ///< see topology.hpp
  size_t degenerate_triangles = 0;
};

/// The vertices of `clusters` are indices into `position_ids`.
ClusterTopology cluster_topology(const ClusterSet& clusters,
                                 std::span<const uint32_t> position_ids);

}  // namespace umbel::lod
