// Verification of what needs no geometry.
#pragma once

#include "lod/verify/findings.hpp"

namespace umbel::lod {

/// Whether every index in the tables leads to what it should. Only then may anything follow them.
bool verify_links(const Tables& tables, Findings& findings);

/// That errors and spheres never shrink from a generating group to the groups of what it
/// generated, nor from a node of the hierarchy's children to the node.
void verify_monotone(const Tables& tables, Findings& findings);

/// Whether sphere `outer` contains `inner`, but for rounding.
bool contains(const Sphere& outer, const Sphere& inner);

}  // namespace umbel::lod
