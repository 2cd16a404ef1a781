// From the parts that units have left to an asset, in a memory that does not depend on how many
// triangles there are: some 300 bytes a group (of some 3,500 triangles), and a few blocks of parts.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "scale/tiers.hpp"
#include "umbel/asset.hpp"
#include "umbel/lod/build.hpp"
#include "umbel/types.hpp"

namespace umbel::scale {

/// What has been built.
struct FinishInput {
  std::vector<std::filesystem::path> parts;  ///< files of parts of all units, by serial number
  std::vector<Task> units;                   ///< that left them; only for FinishOptions::run
  lod::Config config;
  /// Of the whole build, but for what it says of groups, which the parts know.
  lod::Report report;
  uint64_t source_digest = 0;
};

/// What has been written.
struct Finished {
  lod::Report report;  ///< as given, with groups_by_method and groups_by_limiting_factor
  uint32_t levels = 0, groups = 0, clusters = 0;
  uint64_t triangles = 0;  ///< of all levels
  uint64_t bytes = 0;      ///< of the asset
  /// That lost their area as positions were rounded: of the whole build.
  uint64_t collapsed_triangles = 0;
};

struct FinishOptions {
  /// All that the asset has besides the one mesh: `meshes` is empty.
  AssetContents contents;
  /// Follow contents.files; they are read once all groups are encoded, and take no memory before.
  std::vector<std::filesystem::path> files;
  AssetConfig asset;
  /// Where it is set, it makes the metadata once everything but the bytes is known.
  std::function<std::string(const Finished&)> metadata;
  /// A folder with room for as much as the asset takes. Nothing is left there, but for what tasks
  /// leave.
  std::filesystem::path work;
  /// Where it is set, groups are encoded as tasks, in the work folder that the parts are in. They
  /// themselves need not be on this machine, their summaries must.
  WatchedTaskRunner run;
};

/// Writes the asset beside `path` and renames it, so that a file of that name is always whole. The
/// bytes are those that write_asset gives for the same groups in memory, for any number of threads.
/// The parts stay as they are, so it can be run again. Throws kIo, kCancelled, kCorrupt for a
/// damaged file of parts, and what write_asset throws.
Finished finish(const std::filesystem::path& path, const FinishInput& input,
                const FinishOptions& options, const BuildOptions& build = {});

}  // namespace umbel::scale
