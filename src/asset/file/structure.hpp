// What tables must hold for selection, streaming and reading to be safe at all. Whether errors,
// spheres and links are also *right* is for lod::verify to say.
#pragma once

#include <string>

#include "umbel/lod.hpp"

namespace umbel::asset {

/// A sentence naming the first thing that is structurally impossible, or nothing: a range or
/// link that leaves its table, clusters that are not in exactly one group, nodes that are no tree.
std::string structural_problem(const lod::Tables& tables);

}  // namespace umbel::asset
