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
  const lod::Dag sphere = synthetic_dag(shapes::sphere(1), {8, 2});
  const lod::Dag fan = synthetic_dag(shapes::fan(5));
  AssetContents contents;
  contents.meshes = {&sphere, &fan};
  contents.instances = {{1}, {0}, {1}};
  contents.metadata = "{\"a\": 1}";
  contents.files = {{std::byte{1}, std::byte{2}, std::byte{3}}};
  AssetConfig config;
  config.page_bytes = 4096;
  write_asset(scratch / "whole.umbel", contents, {}, config);
  return read_bytes(scratch / "whole.umbel");
}

/// Opens the asset and reads all of it; the code of the error, or nothing if all is well.
std::optional<ErrorCode> failure_of(const std::filesystem::path& path) {
  try {
    const Asset asset(path);
    for (uint32_t m = 0; m < asset.meshes().size(); ++m)
      for (uint32_t c = 0; c < asset.tables(m).clusters.size(); ++c) asset.geometry(c, m);
    for (uint32_t p = 0; p < asset.info().pages; ++p)
      if (!asset.page_is_whole(p)) return ErrorCode::kCorrupt;
    for (uint32_t f = 0; f < asset.files(); ++f) asset.file(f);
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

constexpr size_t kHeaderBytes = 128, kSectionBytes = 40, kSections = 10;
constexpr size_t kFileSection = 7, kPageSection = 8, kNodeSection = 9;

/// Where a section's entry is in the table.
size_t entry_of(const std::vector<char>& bytes, size_t section) {
  return get(bytes, 12, 4) + section * kSectionBytes;
}

void repair(std::vector<char>& bytes, size_t checksum_at, size_t offset, size_t size) {
  if (offset <= bytes.size() && size <= bytes.size() - offset)
    put(bytes, checksum_at, 8, xxh64(bytes.data() + offset, size));
}

/// Of a table whose elements have an offset, a size of `size_bytes` bytes, and end in a checksum.
void repair_elements(std::vector<char>& bytes, size_t section, size_t size_bytes) {
  const size_t entry = entry_of(bytes, section);
  const size_t table = get(bytes, entry + 8, 8), count = get(bytes, entry + 24, 8);
  if (table > bytes.size() || count > (bytes.size() - table) / 24) return;
  for (size_t at = table; at < table + 24 * count; at += 24)
    repair(bytes, at + 16, get(bytes, at, 8), get(bytes, at + 8, size_bytes));
}

void repair_checksums(std::vector<char>& bytes) {
  const size_t header = get(bytes, 12, 4);
  if (header < kHeaderBytes || header + kSections * kSectionBytes > bytes.size()) return;
  repair_elements(bytes, kPageSection, 4);
  repair_elements(bytes, kFileSection, 8);
  for (size_t section = 0; section < kSections; ++section) {
    const size_t entry = entry_of(bytes, section);
    repair(bytes, entry + 32, get(bytes, entry + 8, 8), get(bytes, entry + 16, 8));
  }
  const size_t head = get(bytes, 24, 8);
  if (head >= header) repair(bytes, 32, header, head - header);
  put(bytes, header - 8, 8, xxh64(bytes.data(), header - 8));
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

/// Puts more of header, all of one value, after the known fields.
std::vector<char> with_longer_header(const std::vector<char>& whole) {
  // So many bytes that pages stay aligned; what they are more than a header may have is head.
  constexpr size_t kPage = 4096, kMore = 64;
  std::vector<char> bytes = whole;
  bytes.insert(bytes.begin() + 120, kMore, 'x');
  const size_t old_head = get(whole, 24, 8), head = old_head + kPage;
  bytes.insert(bytes.begin() + static_cast<ptrdiff_t>(old_head + kMore), kPage - kMore, 0);
  put(bytes, 10, 2, 1);
  put(bytes, 12, 4, kHeaderBytes + kMore);
  put(bytes, 16, 8, bytes.size());
  put(bytes, 24, 8, head);
  for (size_t section = 0; section < kSections; ++section) {
    const size_t at = entry_of(bytes, section) + 8;
    put(bytes, at, 8, get(bytes, at, 8) + (section == kNodeSection ? kPage : kMore));
  }
  for (const size_t section : {kPageSection, kFileSection}) {
    const size_t table = get(bytes, entry_of(bytes, section) + 8, 8);
    const size_t count = get(bytes, entry_of(bytes, section) + 24, 8);
    for (size_t i = 0; i < count; ++i)
      put(bytes, table + 24 * i, 8, get(bytes, table + 24 * i, 8) + kPage);
  }
  repair_checksums(bytes);
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
  put(bytes, 8, 2, 4);
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
