// One task of a build in units, on whatever machine.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "io/source/triangle_source.hpp"
#include "scale/tiers.hpp"

namespace umbel::scale {

/// What a machine has of a task's input besides the folder.
struct TaskInput {
  /// Numbers of the sorted files that have something for the unit, rising, where a machine was
  /// given only these; without them all are read.
  std::optional<std::vector<uint32_t>> shards;
  /// Fetches the positions that are taken (taken_file): large, and few units need them.
  std::function<void()> fetch_taken;
  /// For sorting the source.
  const io::TriangleSource* source = nullptr;
};

/// Does a task by what is in the folder alone. Whoever does it again does no harm: files get their
/// names when they are whole, and their bytes are always the same.
void run_task(const std::filesystem::path& work, const Task& task, const TaskInput& input = {});

}  // namespace umbel::scale
