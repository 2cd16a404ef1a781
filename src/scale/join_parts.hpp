// All parts as one DAG in memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "umbel/lod/build.hpp"

namespace umbel::scale {

/// The groups of all units, given as their files of Parts by serial number, level by level and in
/// each by unit. Levels without groups are left out. Sets the tables, vertices, and what the report
/// says of groups; `dag.config` must be set.
void join_parts(const std::vector<std::filesystem::path>& files, lod::Dag& dag);

}  // namespace umbel::scale
