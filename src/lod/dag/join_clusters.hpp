// Clusters as an ordinary mesh, whoever knows where they are.
#pragma once

#include <cstdint>
#include <span>

#include "umbel/lod/types.hpp"

namespace umbel::lod {

/// What joining needs of a cluster besides its geometry.
struct JoinedCluster {
  uint32_t id;  ///< for messages
  uint32_t material, triangles;
};

/// Joins clusters in their order: vertices that are equal in every bit become one. `geometry` is
/// called with 0, 1, 2, ...
Mesh join_clusters(std::span<const JoinedCluster> cut, const GeometryReader& geometry);

}  // namespace umbel::lod
