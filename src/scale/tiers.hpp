// Builds tier by tier through a work folder, until one unit is left. Whoever runs the tasks of a
// tier may do so in any order, in any number of processes: all that they need is in the folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "io/source/triangle_source.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::scale {

struct ScaleConfig {
  uint64_t capacity = uint64_t{4} << 20;  ///< triangles of a unit
  uint32_t rounds = 0;                    ///< levels that a tier makes; 0: by the capacity

  /// What stays at the border of a unit costs quality, the more the longer it stays: of small
  /// units, borders are so large a part that they move after every level.
  uint32_t rounds_of_tier() const {
    constexpr uint64_t kLarge = uint64_t{2} << 20;
    return rounds > 0 ? rounds : capacity >= kLarge ? 2 : 1;
  }
};

enum class TaskKind : uint8_t {
  kBuild,   ///< a unit
  kSort,    ///< brings to the units of a tier what one unit of the tier before left, or one stretch
            ///< of the source has; `unit` is its number
  kEncode,  ///< the groups of a unit, for the asset
};

struct Task {
  uint32_t tier, unit;
  TaskKind kind = TaskKind::kBuild;
  uint64_t plan = 0;  ///< kEncode: which plan, see encode.hpp
};

/// Runs every task once; returns when all are done.
using TaskRunner = std::function<void(std::span<const Task>)>;

/// Runs every task once, and returns when all are done; may call the function with how many are.
using WatchedTaskRunner =
    std::function<void(std::span<const Task>, const std::function<void(size_t)>&)>;

/// What goes to whoever runs the tasks, besides building units.
struct Delegation {
  bool sorting = false;   ///< of what units have left
  bool source = false;    ///< sorting of the source, which others can read as well
  bool encoding = false;  ///< of groups, for the asset
  /// The folder stands for one elsewhere, which alone has parts, exits and what others sorted. What
  /// says that they are there is here.
  bool is_stand_in = false;
};

struct TierOptions {
  WatchedTaskRunner run;
  Delegation delegation;
  /// Of everything, up to 0.9: writing the asset is the rest. May throw, to stop.
  std::function<void(double fraction, std::string_view stage)> progress;
  /// The input is known to be that of the build that the folder has: it is not read to make sure.
  bool input_is_same = false;
  /// Build even where over 1 % of the triangles lose their area as positions are rounded.
  bool force = false;
};

/// What is left once all units are built.
struct BuiltTiers {
  std::vector<std::filesystem::path> parts;  ///< rising by serial number
  std::vector<Task> units;                   ///< that left them
  lod::Report report;                        ///< but for what it says of groups
  uint64_t source_digest = 0;
  Vec3d origin{};  ///< that positions are relative to
  /// Triangles that lost their area as positions were rounded; report.largest_move says how far.
  uint64_t collapsed_triangles = 0;
};

/// Throws kInvalidArgument where no source that has these can be built with it. The numbers
/// of materials are checked by build_tiers.
void check_config(const lod::Config& config, const io::SourceStreams& streams);

/// Builds all of a source, unit by unit. What the folder has of an earlier build, which was of the
/// same input and configuration, is taken where it is whole. Throws what build_in_tiers throws, and
/// kInvalidArgument where the input is another.
BuiltTiers build_tiers(const io::TriangleSource& source, const lod::Config& config,
                       const ScaleConfig& scale, const std::filesystem::path& work,
                       const TierOptions& options);

/// The same, and all groups as one DAG in memory. It is the same for any way to run the tasks. Its
/// report has no seconds. Throws kUnsupported for a configuration with measured_error, which needs
/// the whole source, or a position_step.
lod::Dag build_in_tiers(const io::TriangleSource& source, const lod::Config& config,
                        const ScaleConfig& scale, const std::filesystem::path& work,
                        const TaskRunner& run_tasks);

}  // namespace umbel::scale
