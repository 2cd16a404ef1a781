// New positions for vertices of what a group has become.
#pragma once

#include <span>

#include "lod/simplify/candidate.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

/// Moves the vertices of some triangles of `result.mesh` to `positions`, unscaled, one a position
/// of the group. No triangle may be left that has some of these positions but is not given. What
/// they are joined by there may be non-manifold: nothing else is at new positions. Returns the
/// farthest that one moved.
float move_vertices(const GroupMesh& group, std::span<const Triangle> triangles,
                    std::span<const Vec3> positions, Simplified& result);

/// Gives all vertices new positions, where they are: they are moved apart from what was there
/// (new_positions.hpp). Only where no other group has any of them.
void renew_positions(const GroupMesh& group, Simplified& result);

}  // namespace umbel::lod
