// The file that a fuzzer writes and reads again.
#pragma once

#include <filesystem>
#include <random>
#include <string>

namespace umbel::fuzz {

struct ScratchFile {
  std::string path = (std::filesystem::temp_directory_path() /
                      ("umbel_fuzz_" + std::to_string(std::random_device{}())))
                         .string();
  ScratchFile() = default;
  ScratchFile(const ScratchFile&) = delete;
  ~ScratchFile() {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
};

/// Its name; it is removed in the end.
inline const std::string& scratch() {
  static const ScratchFile file;
  return file.path;
}

}  // namespace umbel::fuzz
