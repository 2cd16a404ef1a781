// Verification of cuts, by counting each one's triangles at each edge.
#pragma once

#include "base/progress.hpp"
#include "lod/verify/verify_geometry.hpp"

namespace umbel::lod {

/// Random cuts and one cut a level; sets `cuts` to the number of random ones.
void verify_cuts(const Tables& tables, const Topology& topology, const VerifyConfig& config,
                 uint32_t& cuts, Findings& findings, Progress& progress);

}  // namespace umbel::lod
