// Positions that the caller holds: those of vertices that it has locked, and the ends of open
// edges.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"

namespace umbel::lod {

/// Position ids, ascending. `locked` are positions of the source; with `borders` both ends of each
/// edge that one triangle of the finest clusters has.
std::vector<uint32_t> held_positions(const Source& source, const ClusterSet& finest,
                                     std::span<const Vec3> locked, bool borders);

}  // namespace umbel::lod
