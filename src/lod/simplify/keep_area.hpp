// Leaves, grass, rubble: many small connected components. Simplified one by one they shrink and are
// removed, and what they cover is lost. Those that are left are enlarged about their centroids
// until all cover as much area as before (Cook, Halstead, Planck & Ryu, "Stochastic Simplification
// of Aggregate Detail", 2007).
#pragma once

#include "lod/dag/unused_positions.hpp"
#include "lod/simplify/candidate.hpp"
#include "lod/simplify/group_components.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

/// `result` is what the group has become, `area_before` the group's area. With `unused`, components
/// stay as they are that would need other positions than those.
void keep_area(const GroupMesh& group, GroupComponents& components, double area_before,
               const UnusedPositions* unused, Simplified& result);

/// Whether that would enlarge something: for groups that may not have new positions.
bool loses_area(const GroupMesh& group, GroupComponents& components, double area_before,
                const Simplified& result);

}  // namespace umbel::lod
