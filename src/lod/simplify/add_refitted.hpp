// Vertices that stay, with attributes refitted to the part of the surface that each now stands for
// (Hoppe 1999): the values that minimise the attribute quadrics there.
#pragma once

#include "lod/simplify/candidate.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

/// Puts the candidate's refitted vertices in the place of the old ones in `result.mesh`.
void add_refitted(const GroupMesh& group, const Candidate& candidate, Simplified& result);

}  // namespace umbel::lod
