// Repairs what edge collapse without the link condition leaves behind: edges with too many
// triangles and, where they must not be, new edges between locked vertices (topology.hpp).
//
// Two triangles back to back on three positions bound nothing and are taken out. Otherwise the edge
// is flipped in the patch where that moves the surface least, or, where no flip is sound, split by
// a vertex of the source that simplification had removed. All of these keep the boundary of the
// sub-mesh, and cost far less than simplifying again.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::lod {

struct RepairInput {
  std::span<const uint32_t> position_of;  ///< local vertex -> local position
  std::span<const Vec3> positions;        ///< of local vertices
  std::span<const uint8_t> locked;        ///< of local positions
  std::span<const uint64_t> patch_of;     ///< of local vertices: component and material
  std::span<const uint8_t> spare;  ///< of local vertices: may be brought back to split an edge
                                   ///< (not locked, alone at its position)
};

/// Repairs each edge of `faults` (pairs of local positions) that it can. Returns the largest
/// distance by which that moved the surface.
float repair_edges(const RepairInput& input, std::span<const std::pair<uint32_t, uint32_t>> faults,
                   std::vector<Triangle>& triangles);

}  // namespace umbel::lod
