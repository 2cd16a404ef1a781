// What verification asks of one cluster by itself, and of level 0 as a whole.
#pragma once

#include <functional>

#include "lod/verify/findings.hpp"

namespace umbel::lod {

/// Checks sizes, indices, box and sphere; whether the geometry can be used at all.
bool check_cluster(uint32_t number, const Cluster& cluster, const Group& group,
                   const ClusterGeometry& geometry, const VerifyConfig& config, Findings& findings);

void name_unreadable(uint32_t cluster, const char* why, Findings& findings);

/// That level 0 is the source. `digest` is asked for only if the number of triangles is right.
void verify_source(uint64_t triangles, const std::function<uint64_t()>& digest,
                   const VerifyConfig& config, Findings& findings);

}  // namespace umbel::lod
