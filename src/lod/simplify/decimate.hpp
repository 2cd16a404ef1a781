// The caller's own decimation of a group: what it is given, and whether what it gives back can take
// the group's place.
#pragma once

#include "lod/simplify/candidate.hpp"
#include "lod/simplify/candidate_check.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

/// Asks for `target` triangles and takes at most `most`; asks again where it refuses. False: the
/// group is to be simplified otherwise, and is as it was. Throws kInvalidArgument where the result
/// is no mesh.
bool decimate_by_caller(const Decimator& decimate, size_t target, size_t most, GroupMesh& group,
                        CandidateCheck& check, Candidate& candidate);

}  // namespace umbel::lod
