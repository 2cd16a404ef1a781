// Builds tier by tier through a work folder, until one unit is left. Whoever runs the tasks of a
// tier may do so in any order, in any number of processes: all that they need is in the folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>

#include "io/source/triangle_source.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::scale {

struct ScaleConfig {
  uint64_t capacity = uint64_t{4} << 20;  ///< triangles of a unit
  uint32_t rounds = 2;                    ///< levels that a tier makes
};

struct Task {
  uint32_t tier, unit;
};

/// Runs every task once; returns when all are done.
using TaskRunner = std::function<void(std::span<const Task>)>;

/// One task, by what is in the folder alone.
void run_task(const std::filesystem::path& work, const Task& task);

/// Builds all of a source. The folder must be empty. The DAG is the same for any way to run the
/// tasks. Its report has no seconds. Throws kUnsupported for a configuration with measured_error,
/// which needs the whole source, or a position_step.
lod::Dag build_in_tiers(const io::TriangleSource& source, const lod::Config& config,
                        const ScaleConfig& scale, const std::filesystem::path& work,
                        const TaskRunner& run_tasks);

}  // namespace umbel::scale
