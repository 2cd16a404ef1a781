// Verification of cuts, by counting each one's triangles at each edge.
#pragma once

#include "base/progress.hpp"
#include "lod/verify/verify_geometry.hpp"
#include "umbel/lod/select.hpp"

namespace umbel::lod {

/// Random cuts and one cut a level; sets `cuts` to the number of random ones.
void verify_cuts(const Tables& tables, const Topology& topology, const VerifyConfig& config,
                 uint32_t& cuts, Findings& findings, Progress& progress);

/// Checks a part of a cut: all clusters of a topology, whose numbers in the tables are given. Edges
/// that leave the part are to be allowed.
void verify_part_of_cut(const Topology& topology, std::span<const uint32_t> numbers,
                        const View& view, Findings& findings);

}  // namespace umbel::lod
