// Assets of meshes that do not fit into memory, built in units: parts of space that do
// (docs/scale.md).
//
//   UnitsConfig config;
//   config.work = "city.work";             // some 45 bytes a triangle
//   config.memory_bytes = 2'000'000'000;
//   build_in_units("city.umbel", source, config);
//
// Where it is stopped, by an exception, a signal or a full disk, config.resume goes on. The bytes
// depend on the source and the settings alone.
//
// Units are built in this process, one after the other by all threads. To build several side by
// side, each in a process of its own, name a program that calls run_unit_worker:
//
//   int main(int argc, char** argv) {
//     if (argc > 1 && argv[1] == std::string_view("--unit")) return run_unit_worker(argc, argv);
//     ...
//     config.worker = {argv[0], "--unit"};
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "umbel/asset.hpp"
#include "umbel/lod/build.hpp"
#include "umbel/triangle_source.hpp"
#include "umbel/types.hpp"

namespace umbel {

struct UnitsConfig {
  /// Settings that need the whole mesh are refused: measured_error, lock_borders, position_step.
  lod::Config lod;
  /// Most triangles of a unit, at least 1000. Smaller ones need less memory and leave slightly
  /// coarser levels: this changes the result.
  uint64_t unit_triangles = uint64_t{4} << 20;
  AssetConfig asset = AssetConfig::exact();
  /// All that the asset has besides its mesh: metadata, materials, files, scene. `meshes`,
  /// `instances` and `origin` are given by the build.
  AssetContents contents;

  /// A folder for what is built before it is whole. It must be empty, or of a build that was
  /// stopped; it is removed at the end.
  std::filesystem::path work;
  bool resume = false;
  /// Build even where over 1 % of the triangles lose their area as positions become 32-bit floats
  /// about one origin; else that is kInvalidMesh.
  bool force = false;
  /// What is built, in words: a build is only resumed for the same.
  std::string input;
  /// Throws kInvalidArgument, saying what would do, where this is too little; 0: no limit.
  uint64_t memory_bytes = 0;
  /// A program that builds one unit and its first arguments, see above; empty: this process.
  std::vector<std::string> worker;
  uint32_t workers = 0;  ///< side by side; 0: as many as memory and cores allow
};

struct UnitsReport {
  lod::Report lod;  ///< input_vertices is 0: units cannot know it. largest_move: by rounding
  uint64_t collapsed_triangles = 0;  ///< that lost their area by rounding
  uint32_t levels = 0, groups = 0, clusters = 0;
  uint64_t triangles = 0;  ///< of all levels
  uint64_t file_bytes = 0;
  uint32_t workers = 1;
};

/// Writes beside `path` and renames, so that a file of that name is always whole. Throws what
/// lod::build and write_asset throw, what the source throws, and kCancelled; the work folder then
/// has all that was done. Throws kInvalidArgument where the folder is another build's or
/// anybody's, or has a build of other settings or another source.
UMBEL_API UnitsReport build_in_units(const std::filesystem::path& path,
                                     const TriangleSource& source, const UnitsConfig& config,
                                     const BuildOptions& options = {});

/// What a worker's program ends with: builds the unit that the last three arguments name. What goes
/// wrong is said in a sentence on standard error, and by the status that is returned.
UMBEL_API int run_unit_worker(int argc, const char* const* argv, uint32_t threads = 1);

}  // namespace umbel
