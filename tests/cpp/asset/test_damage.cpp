#include <gtest/gtest.h>

#include <optional>

#include "asset/scratch.hpp"
#include "asset/synthetic_dag.hpp"
#include "base/hash.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::read_bytes;
using testing::Scratch;
using testing::synthetic_dag;
using testing::write_bytes;

std::vector<char> small_asset(const Scratch& scratch) {
  write_asset(scratch / "whole.umbel", synthetic_dag(shapes::sphere(1), {8, 2}), "{\"a\": 1}");
  return read_bytes(scratch / "whole.umbel");
}

/// Opens the asset and reads all of it; the code of the error, or nothing if all is well.
std::optional<ErrorCode> failure_of(const std::filesystem::path& path) {
  try {
    const Asset asset(path);
    for (uint32_t c = 0; c < asset.tables().clusters.size(); ++c) asset.geometry(c);
    for (uint32_t g = 0; g < asset.tables().groups.size(); ++g)
      if (!asset.page_is_whole(g)) return ErrorCode::kCorrupt;
  } catch (const Error& error) {
    EXPECT_GT(std::string(error.what()).size(), 10u);
    return error.code();
  }
  return std::nullopt;
}

TEST(AssetDamage, any_byte_that_is_changed_is_noticed) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  ASSERT_EQ(failure_of(scratch / "whole.umbel"), std::nullopt);
  ASSERT_LT(whole.size(), 20000u);
  for (size_t at = 0; at < whole.size(); ++at)
    for (int flip : {0xff, 0x01}) {
      std::vector<char> bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ flip);
      write_bytes(scratch / "b.umbel", bytes);
      ASSERT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kCorrupt) << "byte " << at;
    }
}

TEST(AssetDamage, any_length_but_the_right_one_is_noticed) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  write_bytes(scratch / "b.umbel", whole);
  for (size_t size = whole.size(); size-- > 0;) {
    std::filesystem::resize_file(scratch / "b.umbel", size);
    ASSERT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kCorrupt) << size << " bytes";
  }
  std::vector<char> longer = whole;
  longer.push_back(0);
  write_bytes(scratch / "b.umbel", longer);
  EXPECT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kCorrupt);
}

TEST(AssetDamage, garbage_is_not_an_asset) {
  const Scratch scratch;
  uint64_t state = 1;
  for (size_t size : {0u, 1u, 15u, 16u, 127u, 128u, 1000u, 100000u})
    for (int run = 0; run < 20; ++run) {
      std::vector<char> bytes(size);
      for (char& byte : bytes) byte = static_cast<char>(mix64(++state));
      write_bytes(scratch / "b.umbel", bytes);
      ASSERT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kCorrupt);
    }
}

TEST(AssetDamage, a_file_cut_short_while_open_is_an_error) {
  const Scratch scratch;
  small_asset(scratch);
  const Asset asset(scratch / "whole.umbel");
  std::filesystem::resize_file(scratch / "whole.umbel", 1000);
  EXPECT_THROW(asset.geometry(0), Error);
}

// ---- files whose checksums are right and whose contents are not -------------------------------

uint64_t get(const std::vector<char>& bytes, size_t at, size_t size) {
  uint64_t value = 0;
  for (size_t i = 0; i < size; ++i)
    value |= uint64_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
  return value;
}

void put(std::vector<char>& bytes, size_t at, size_t size, uint64_t value) {
  for (size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<char>(value >> (8 * i));
}

constexpr size_t kHeaderBytes = 128, kSectionBytes = 32, kSections = 7, kPageSection = 6;

void repair_page_checksums(std::vector<char>& bytes) {
  const size_t table = get(bytes, kHeaderBytes + kPageSection * kSectionBytes + 8, 8);
  const size_t pages = get(bytes, kHeaderBytes + kPageSection * kSectionBytes + 24, 8);
  if (table > bytes.size() || pages > (bytes.size() - table) / 32) return;
  for (size_t i = 0; i < pages; ++i) {
    const size_t offset = get(bytes, table + 32 * i, 8), size = get(bytes, table + 32 * i + 8, 8);
    if (offset > bytes.size() || size > bytes.size() - offset) continue;
    put(bytes, table + 32 * i + 16, 8, xxh64(bytes.data() + offset, size));
  }
}

void repair_checksums(std::vector<char>& bytes) {
  repair_page_checksums(bytes);
  const size_t head = get(bytes, 24, 8);
  if (head >= kHeaderBytes && head <= bytes.size())
    put(bytes, 32, 8, xxh64(bytes.data() + kHeaderBytes, head - kHeaderBytes));
  put(bytes, 120, 8, xxh64(bytes.data(), 120));
}

TEST(AssetDamage, repairing_checksums_repairs_nothing_in_a_whole_file) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  std::vector<char> bytes = whole;
  repair_checksums(bytes);
  EXPECT_TRUE(bytes == whole);
}

TEST(AssetDamage, wrong_values_under_right_checksums_are_errors_or_harmless) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  size_t refused = 0;
  for (size_t at = 0; at + 4 <= whole.size(); at += 4)
    for (uint64_t value : {0xffffffffu, 0x7fffffffu, 0u, 257u}) {
      std::vector<char> bytes = whole;
      put(bytes, at, 4, value);
      repair_checksums(bytes);
      write_bytes(scratch / "b.umbel", bytes);
      const std::optional<ErrorCode> failure = failure_of(scratch / "b.umbel");
      if (failure) {
        ++refused;
        ASSERT_TRUE(*failure == ErrorCode::kCorrupt || *failure == ErrorCode::kUnsupported)
            << "byte " << at;
      }
    }
  EXPECT_GT(refused, 500u);
}

TEST(AssetDamage, random_changes_under_right_checksums_never_crash) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  const size_t head = get(whole, 24, 8);
  uint64_t state = 7;
  for (int run = 0; run < 3000; ++run) {
    std::vector<char> bytes = whole;
    const size_t among = run % 2 ? head : bytes.size();
    for (uint64_t change = mix64(++state) % 4 + 1; change > 0; --change) {
      const size_t at = mix64(++state) % among;
      bytes[at] = static_cast<char>(mix64(++state));
    }
    repair_checksums(bytes);
    write_bytes(scratch / "b.umbel", bytes);
    const auto report = verify_asset(scratch / "b.umbel", 2);
    if (!report.ok) {
      EXPECT_FALSE(report.problems.empty());
    }
  }
}

TEST(AssetDamage, a_newer_minor_version_is_read_and_its_new_sections_are_skipped) {
  const Scratch scratch;
  std::vector<char> bytes = small_asset(scratch);
  put(bytes, 10, 2, 7);
  repair_checksums(bytes);
  write_bytes(scratch / "b.umbel", bytes);
  EXPECT_EQ(failure_of(scratch / "b.umbel"), std::nullopt);
  EXPECT_EQ(Asset(scratch / "b.umbel").info().version_minor, 7);

  // The metadata's section under another name, and in its place another of that kind.
  std::vector<char> renamed = bytes;
  renamed[kHeaderBytes] = 'Z';
  repair_checksums(renamed);
  write_bytes(scratch / "b.umbel", renamed);
  EXPECT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kCorrupt);  // META is missing
}

/// Puts `bytes` more of header, all of one value, after the known fields.
std::vector<char> with_longer_header(const std::vector<char>& whole) {
  // 64 bytes keep the pages aligned.
  constexpr size_t kMore = 64;
  std::vector<char> bytes = whole;
  bytes.insert(bytes.begin() + 120, kMore, 'x');
  put(bytes, 10, 2, 1);
  put(bytes, 12, 4, kHeaderBytes + kMore);
  put(bytes, 16, 8, bytes.size());
  const size_t head = get(whole, 24, 8) + kMore;
  put(bytes, 24, 8, head);
  for (size_t section = 0; section < kSections; ++section) {
    const size_t at = kHeaderBytes + kMore + section * kSectionBytes + 8;
    put(bytes, at, 8, get(bytes, at, 8) + kMore);
  }
  const size_t pages = get(bytes, kHeaderBytes + kMore + kPageSection * kSectionBytes + 8, 8);
  const size_t count = get(bytes, kHeaderBytes + kMore + kPageSection * kSectionBytes + 24, 8);
  for (size_t i = 0; i < count; ++i)
    put(bytes, pages + 32 * i, 8, get(bytes, pages + 32 * i, 8) + kMore);
  put(bytes, 32, 8, xxh64(bytes.data() + kHeaderBytes + kMore, head - kHeaderBytes - kMore));
  put(bytes, 120 + kMore, 8, xxh64(bytes.data(), 120 + kMore));
  return bytes;
}

TEST(AssetDamage, a_longer_header_of_a_newer_minor_version_is_read) {
  const Scratch scratch;
  write_bytes(scratch / "b.umbel", with_longer_header(small_asset(scratch)));
  EXPECT_EQ(failure_of(scratch / "b.umbel"), std::nullopt);
}

TEST(AssetDamage, a_newer_major_version_is_unsupported) {
  const Scratch scratch;
  std::vector<char> bytes = small_asset(scratch);
  put(bytes, 8, 2, 3);
  repair_checksums(bytes);
  write_bytes(scratch / "b.umbel", bytes);
  EXPECT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kUnsupported);
}

TEST(AssetDamage, files_that_are_none_are_refused) {
  const Scratch scratch;
  EXPECT_EQ(failure_of(scratch / "missing.umbel"), ErrorCode::kIo);
  EXPECT_EQ(failure_of(std::filesystem::temp_directory_path()), ErrorCode::kIo);
  if (std::filesystem::exists("/dev/zero")) {
    EXPECT_EQ(failure_of("/dev/zero"), ErrorCode::kIo);
  }
}

}  // namespace
}  // namespace umbel
