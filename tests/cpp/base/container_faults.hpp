// Faults in files of arrays (base/container.hpp), for the tests of whoever reads such files.
#pragma once

#include <gtest/gtest.h>

#include <optional>

#include "asset/scratch.hpp"
#include "base/hash.hpp"
#include "umbel/types.hpp"

namespace umbel::testing {

inline uint64_t get_word(const std::vector<char>& bytes, size_t at) {
  uint64_t value = 0;
  for (size_t i = 0; i < 8; ++i)
    value |= uint64_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
  return value;
}

inline void put_word(std::vector<char>& bytes, size_t at, size_t size, uint64_t value) {
  for (size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<char>(value >> (8 * i));
}

inline void repair_container_checksums(std::vector<char>& bytes) {
  for (size_t entry = 112; entry < 184; entry += 24) {
    const uint64_t offset = get_word(bytes, entry), size = get_word(bytes, entry + 8);
    if (offset > bytes.size() || size > bytes.size() - offset) continue;
    put_word(bytes, entry + 16, 8, xxh64(bytes.data() + offset, size));
  }
  put_word(bytes, 184, 8, xxh64(bytes.data(), 184));
}

using Failure = std::optional<ErrorCode>;

// `failure_of(path)` loads a file and asks what was loaded for everything; an error's code.

template <typename FailureOf>
void expect_changed_bytes_are_noticed(const std::vector<char>& whole, const FailureOf& failure_of) {
  const Scratch scratch;
  for (size_t at = 0; at < whole.size(); ++at)
    for (const int flip : {0xff, 0x01}) {
      std::vector<char> bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ flip);
      write_bytes(scratch / "b", bytes);
      ASSERT_EQ(failure_of(scratch / "b"), ErrorCode::kCorrupt) << "byte " << at;
    }
}

template <typename FailureOf>
void expect_other_lengths_are_noticed(std::vector<char> bytes, const FailureOf& failure_of) {
  const Scratch scratch;
  write_bytes(scratch / "b", bytes);
  for (size_t size = bytes.size(); size-- > 0;) {
    std::filesystem::resize_file(scratch / "b", size);
    ASSERT_EQ(failure_of(scratch / "b"), ErrorCode::kCorrupt) << size << " bytes";
  }
  bytes.push_back(0);
  write_bytes(scratch / "b", bytes);
  ASSERT_EQ(failure_of(scratch / "b"), ErrorCode::kCorrupt);
}

/// Under right checksums; returns how many files were refused.
template <typename FailureOf>
size_t count_wrong_words_refused(const std::vector<char>& whole, const FailureOf& failure_of) {
  const Scratch scratch;
  std::vector<char> bytes = whole;
  repair_container_checksums(bytes);
  EXPECT_TRUE(bytes == whole);
  size_t refused = 0;
  for (size_t at = 0; at + 4 <= whole.size(); at += 4)
    for (const uint64_t value : {0xffffffffu, 0x7fffffffu, 0u, 1u, 0x80000000u, 0xf0000005u}) {
      bytes = whole;
      put_word(bytes, at, 4, value);
      repair_container_checksums(bytes);
      write_bytes(scratch / "b", bytes);
      const Failure failure = failure_of(scratch / "b");
      if (!failure) continue;
      ++refused;
      EXPECT_TRUE(*failure == ErrorCode::kCorrupt || *failure == ErrorCode::kUnsupported)
          << "byte " << at;
    }
  return refused;
}

template <typename FailureOf>
void ask_files_with_random_changes(const std::vector<char>& whole, const FailureOf& failure_of) {
  const Scratch scratch;
  uint64_t state = 7;
  for (int run = 0; run < 400; ++run) {
    std::vector<char> bytes = whole;
    for (uint64_t change = mix64(++state) % 4 + 1; change > 0; --change) {
      const size_t at =
          mix64(++state) % (run % 4 ? bytes.size() : std::min<size_t>(bytes.size(), 1024));
      bytes[at] = static_cast<char>(mix64(++state));
    }
    repair_container_checksums(bytes);
    write_bytes(scratch / "b", bytes);
    (void)failure_of(scratch / "b");
  }
}

template <typename FailureOf>
void expect_other_files_are_refused(std::vector<char> whole, const FailureOf& failure_of) {
  const Scratch scratch;
  put_word(whole, 8, 2, 2);
  repair_container_checksums(whole);
  write_bytes(scratch / "newer", whole);
  EXPECT_EQ(failure_of(scratch / "newer"), ErrorCode::kUnsupported);
  EXPECT_EQ(failure_of(scratch / "missing"), ErrorCode::kIo);
  EXPECT_EQ(failure_of(std::filesystem::temp_directory_path()), ErrorCode::kIo);
  if (std::filesystem::exists("/dev/zero")) {
    EXPECT_EQ(failure_of("/dev/zero"), ErrorCode::kIo);
  }
}

/// save(path) leaves what was there where it cannot write, and no half file.
template <typename Save>
void expect_saving_is_whole_or_nothing(const Save& save) {
  const Scratch scratch;
  EXPECT_THROW(save((scratch / "no_folder" / "a").string()), Error);
  EXPECT_THROW(save(std::filesystem::temp_directory_path().string()), Error);
  if (std::filesystem::exists("/dev/full")) {
    EXPECT_THROW(save("/dev/full"), Error);
  }
  save((scratch / "a").string());
  save((scratch / "a").string());
  EXPECT_EQ(scratch.files(), 1u);
}

}  // namespace umbel::testing
