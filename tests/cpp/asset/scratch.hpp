// A folder for one test's files, and files as bytes.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

namespace umbel::testing {

class Scratch {
 public:
  Scratch() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    const std::string unique = std::to_string(std::random_device{}());
    folder_ = std::filesystem::temp_directory_path() /
              ("umbel_" + std::string(test->name()) + "_" + unique);
    std::filesystem::create_directories(folder_);
  }
  ~Scratch() { std::filesystem::remove_all(folder_); }

  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }

  size_t files() const {
    size_t count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder_)) ++count;
    return count;
  }

 private:
  std::filesystem::path folder_;
};

inline std::vector<char> read_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// In place where the size stays: some file systems flush a file that was emptied and rewritten.
inline void write_bytes(const std::filesystem::path& path, const std::vector<char>& bytes) {
  std::error_code error;
  const bool in_place = std::filesystem::file_size(path, error) == bytes.size() && !error;
  std::ofstream file(path, in_place ? std::ios::binary | std::ios::in : std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace umbel::testing
