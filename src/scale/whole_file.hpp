// Whether a file of a build in units can be used again.
#pragma once

#include <filesystem>

#include "umbel/types.hpp"

namespace umbel::scale {

/// Whether the file is there, and every byte of it is as it was written: what a File's check()
/// says.
template <typename File>
bool is_whole_file(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return false;
  try {
    File(path).check();
    return true;
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kCorrupt) return false;
    throw;
  }
}

}  // namespace umbel::scale
