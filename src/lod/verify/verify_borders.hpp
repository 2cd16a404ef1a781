// Verification that a group's simplified form fits where the group was, for all cuts at once.
#pragma once

#include "lod/verify/verify_geometry.hpp"

namespace umbel::lod {

/// See the .cpp for what this proves.
void verify_borders(const Tables& tables, const Topology& topology, Findings& findings);

}  // namespace umbel::lod
