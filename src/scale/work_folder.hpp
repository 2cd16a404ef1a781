// The folder that a build works in: who may use it, what it was begun for, and the names of its
// files. It outlives a build that is stopped, so that another can go on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "scale/tiers.hpp"

namespace umbel::scale {

/// Names and values that say what a build is of; those of a resumed one must be the same.
using Identity = std::vector<std::pair<std::string, std::string>>;

/// Every setting that decides the result.
Identity identity_of(const lod::Config& config, const ScaleConfig& scale);

/// A folder for one build at a time.
class WorkFolder {
 public:
  /// Makes the folder and holds it until the end. Throws kInvalidArgument, in a sentence that names
  /// the field, where another build uses it, it has a build that was not finished and `resume` is
  /// not set, that build was of other settings, or it holds files of anybody else.
  WorkFolder(std::filesystem::path path, const Identity& identity, bool resume);
  WorkFolder(const WorkFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Whether an earlier build has begun here.
  bool is_resumed() const { return is_resumed_; }
  /// Removes all that the build has made, and the folder unless others have put something there.
  void remove();

 private:
  /// Held until it goes, or the process does.
  struct Lock {
    int descriptor = -1;
    ~Lock();
  };
  void lock();
  void compare(const Identity& identity) const;

  std::filesystem::path path_;
  bool is_resumed_ = false;
  Lock lock_;
};

/// Removes what a killed process has left: files that had not got their names yet.
void remove_temporaries(const std::filesystem::path& folder);

std::filesystem::path tier_folder(const std::filesystem::path& work, uint32_t tier);
std::filesystem::path plan_file(const std::filesystem::path& work, uint32_t tier);
/// What a unit has left; `what` is an ending.
std::filesystem::path unit_file(const std::filesystem::path& work, const Task& task,
                                const char* what);
std::filesystem::path shard_file(const std::filesystem::path& work, uint32_t tier, uint32_t shard);
/// Of TakenPositions, as they were before the tier.
std::filesystem::path taken_file(const std::filesystem::path& work, uint32_t tier);
/// Where in a sorted file is what (SlicePlaces), for machines that do not have the file.
std::filesystem::path places_file(const std::filesystem::path& work, uint32_t tier, uint32_t shard);
/// See encode.hpp.
std::filesystem::path encode_plan_file(const std::filesystem::path& work, uint64_t plan);
std::filesystem::path chunks_file(const std::filesystem::path& work, const Task& task);
/// With those above it; it may be there. Throws kIo.
void make_folder(const std::filesystem::path& path);
void make_tier_folders(const std::filesystem::path& work, uint32_t tier);

}  // namespace umbel::scale
