// From a source of triangles to an asset, in units: everything that `umbel build --memory` does
// below the command.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "io/source/triangle_source.hpp"
#include "scale/executor.hpp"
#include "scale/finish.hpp"
#include "scale/work_folder.hpp"

namespace umbel::scale {

/// How much a build takes.
struct MemoryPlan {
  uint64_t unit_bytes = 0;  ///< of one unit at a time, in a process of its own
  uint64_t least = 0;       ///< that a build can do with: one unit and what is beside it
  uint32_t workers = 1;     ///< units that fit in side by side, no more than cores
};

/// How many vertices a source has, a triangle.
struct VertexShare {
  double given = 0.5;     ///< as it is read, block by block
  double distinct = 0.5;  ///< once equal ones are one
};

/// Of some blocks. `vertices`: of the whole source, where they are known; 0: they are not.
VertexShare vertex_share(const io::TriangleSource& source, uint64_t vertices);

/// For `memory` bytes in all. Throws kInvalidArgument, saying what would do, where that is too
/// little for one unit.
MemoryPlan plan_memory(uint64_t memory, uint32_t cores, uint64_t triangles,
                       const io::SourceStreams& streams, const ScaleConfig& scale,
                       const VertexShare& share = {});

struct AssetBuild {
  lod::Config config;
  ScaleConfig scale;
  FinishOptions finish;
  /// Reported as the mesh's: units cannot know it.
  uint64_t input_vertices = 0;
  bool input_is_same = false, force = false;  ///< see TierOptions
  Delegation delegation;                      ///< what the executor takes besides units
};

/// Builds what the folder does not have yet, and writes the asset. The bytes depend on the source
/// and the configuration alone. Throws kCancelled, and what build_tiers and finish throw; the
/// folder then has all that was done, and another call goes on from there.
Finished build_asset(const io::TriangleSource& source, const AssetBuild& build,
                     const WorkFolder& folder, Executor& executor,
                     const std::filesystem::path& path, const BuildOptions& options = {});

}  // namespace umbel::scale
