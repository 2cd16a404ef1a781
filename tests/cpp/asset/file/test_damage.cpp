#include <gtest/gtest.h>

#include <optional>

#include "asset/edit_file.hpp"
#include "asset/file/format.hpp"
#include "asset/scratch.hpp"
#include "base/hash.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::failure_of;
using testing::get;
using testing::put;
using testing::repair_checksums;
using testing::Scratch;
using testing::small_asset;
using testing::write_bytes;

TEST(AssetDamage, any_byte_that_is_changed_is_noticed) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  ASSERT_EQ(failure_of(scratch / "whole.umbel"), std::nullopt);
  ASSERT_LT(whole.size(), 40000u);
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

TEST(AssetDamage, a_damaged_page_is_reported_with_the_name_of_its_file) {
  const Scratch scratch;
  std::vector<char> bytes = small_asset(scratch);
  write_bytes(scratch / "b.umbel", bytes);
  char& of_page = bytes[Asset(scratch / "b.umbel").info().header_bytes];  // pages come next
  of_page = static_cast<char>(~of_page);
  write_bytes(scratch / "b.umbel", bytes);
  const auto said = [](const Asset& asset) -> std::string {
    try {
      asset.tables();
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };
  const std::string path = (scratch / "b.umbel").string();
  const std::string bare = said(Asset(open_file(path)));
  EXPECT_EQ(bare.rfind("the checksum of ", 0), 0u) << bare;
  EXPECT_EQ(said(Asset(path)), path + ": " + bare);
  EXPECT_EQ(said(Asset(open_file(path), "a store")), "a store: " + bare);
}

TEST(AssetDamage, a_file_cut_short_while_open_is_an_error) {
  const Scratch scratch;
  small_asset(scratch);
  const Asset asset(scratch / "whole.umbel");
  std::filesystem::resize_file(scratch / "whole.umbel", 1000);
  EXPECT_THROW(asset.geometry(0), Error);
}

// ---- files whose checksums are right and whose contents are not -------------------------------

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
  const size_t header_end = get(whole, 24, 8);
  uint64_t state = 7;
  for (int run = 0; run < 3000; ++run) {
    std::vector<char> bytes = whole;
    const size_t among = run % 2 ? header_end : bytes.size();
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

TEST(AssetDamage, other_major_versions_are_unsupported) {
  const Scratch scratch;
  std::vector<char> bytes = small_asset(scratch);
  for (const uint64_t major : {2u, asset::kVersionMajor + 1u}) {
    put(bytes, 8, 2, major);
    repair_checksums(bytes);
    write_bytes(scratch / "b.umbel", bytes);
    EXPECT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kUnsupported);
  }
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
