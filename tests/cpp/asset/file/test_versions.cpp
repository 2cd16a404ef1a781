// What newer minor versions may add, and files far larger than what opening reads of them.
#include <gtest/gtest.h>

#include <cstring>

#include "asset/beginning.hpp"
#include "asset/edit_file.hpp"
#include "asset/scratch.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::Beginning;
using testing::entry_of;
using testing::failure_of;
using testing::get;
using testing::kFileSection, testing::kNodeSection, testing::kPageSection;
using testing::kHeaderBytes, testing::kSectionBytes, testing::kSections;
using testing::put;
using testing::repair_checksums;
using testing::Scratch;
using testing::small_asset;
using testing::write_bytes;

constexpr size_t kPage = 4096;

/// Makes room at an offset of the file header, a multiple of 8 bytes, and as much after it as keeps
/// pages aligned.
std::vector<char> with_room(const std::vector<char>& whole, size_t at, size_t room) {
  const size_t old_end = get(whole, 24, 8), more = (room + kPage - 1) / kPage * kPage;
  std::vector<char> bytes = whole;
  bytes.insert(bytes.begin() + static_cast<ptrdiff_t>(old_end), more - room, 0);
  bytes.insert(bytes.begin() + static_cast<ptrdiff_t>(at), room, 0);
  put(bytes, 10, 2, 7);
  put(bytes, 16, 8, bytes.size());
  put(bytes, 24, 8, old_end + more);
  if (at < kHeaderBytes) put(bytes, 12, 4, kHeaderBytes + room);
  for (size_t section = 0; section < kSections; ++section) {
    const size_t offset = entry_of(bytes, section) + 8;
    if (section == kNodeSection)
      put(bytes, offset, 8, get(bytes, offset, 8) + more);
    else if (get(bytes, offset, 8) >= at)
      put(bytes, offset, 8, get(bytes, offset, 8) + room);
  }
  for (const size_t section : {kPageSection, kFileSection}) {
    const size_t table = get(bytes, entry_of(bytes, section) + 8, 8);
    const size_t count = get(bytes, entry_of(bytes, section) + 24, 8);
    for (size_t i = 0; i < count; ++i)
      put(bytes, table + 24 * i, 8, get(bytes, table + 24 * i, 8) + more);
  }
  return bytes;
}

void expect_readable(std::vector<char> bytes) {
  const Scratch scratch;
  repair_checksums(bytes);
  write_bytes(scratch / "b.umbel", bytes);
  EXPECT_EQ(failure_of(scratch / "b.umbel"), std::nullopt);
  EXPECT_TRUE(verify_asset(scratch / "b.umbel", 2).problems.empty());
  const Asset asset(scratch / "b.umbel");
  small_asset(scratch);
  const Asset known(scratch / "whole.umbel");
  EXPECT_EQ(asset.info().version_minor, 7);
  EXPECT_EQ(asset.info().metadata, known.info().metadata);
  EXPECT_EQ(asset.instances(), known.instances());
  for (uint32_t m = 0; m < 2; ++m) {
    EXPECT_EQ(asset.tables(m).levels, known.tables(m).levels);
    EXPECT_EQ(asset.tables(m).groups, known.tables(m).groups);
    EXPECT_EQ(asset.tables(m).nodes, known.tables(m).nodes);
  }
  EXPECT_EQ(asset.file(0), known.file(0));
}

TEST(AssetVersions, a_newer_minor_version_is_read) {
  const Scratch scratch;
  std::vector<char> bytes = small_asset(scratch);
  put(bytes, 10, 2, 7);
  expect_readable(bytes);
}

TEST(AssetVersions, a_longer_header_is_stepped_over) {
  const Scratch scratch;
  std::vector<char> bytes = with_room(small_asset(scratch), 120, 64);
  std::fill_n(bytes.begin() + 120, 64, 'x');
  expect_readable(bytes);
}

TEST(AssetVersions, unknown_sections_are_skipped) {
  const Scratch scratch;
  const size_t end_of_table = kHeaderBytes + kSections * kSectionBytes;
  std::vector<char> bytes = with_room(small_asset(scratch), end_of_table, kSectionBytes);
  put(bytes, 40, 4, kSections + 1);
  std::memcpy(&bytes[end_of_table], "NEWS", 4);
  put(bytes, end_of_table + 4, 4, 8);
  const size_t at = get(bytes, 24, 8) - 64;  // within the padding of the file header
  put(bytes, end_of_table + 8, 8, at);
  put(bytes, end_of_table + 16, 8, 48);
  put(bytes, end_of_table + 24, 8, 6);
  std::fill_n(bytes.begin() + static_cast<ptrdiff_t>(at), 48, 'n');
  expect_readable(bytes);
}

TEST(AssetVersions, longer_elements_are_stepped_over) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  for (size_t section = 2; section < kNodeSection; ++section) {
    SCOPED_TRACE("section " + std::to_string(section));
    const size_t count = get(whole, entry_of(whole, section) + 24, 8);
    const size_t stride = get(whole, entry_of(whole, section) + 4, 4), longer = stride + 8;
    const size_t old_end = get(whole, 24, 8);
    std::vector<char> bytes = with_room(whole, old_end, (count * longer + 7) / 8 * 8);
    const size_t entry = entry_of(bytes, section), table = get(bytes, entry + 8, 8);
    std::fill_n(bytes.begin() + static_cast<ptrdiff_t>(old_end), count * longer, 'y');
    for (size_t i = 0; i < count; ++i)
      std::copy_n(bytes.begin() + static_cast<ptrdiff_t>(table + i * stride), stride,
                  bytes.begin() + static_cast<ptrdiff_t>(old_end + i * longer));
    put(bytes, entry + 4, 4, longer);
    put(bytes, entry + 8, 8, old_end);
    put(bytes, entry + 16, 8, count * longer);
    expect_readable(bytes);
  }
}

TEST(AssetVersions, a_section_that_must_be_there_is_missed) {
  const Scratch scratch;
  std::vector<char> bytes = small_asset(scratch);
  bytes[kHeaderBytes] = 'Z';  // of META
  repair_checksums(bytes);
  write_bytes(scratch / "b.umbel", bytes);
  EXPECT_EQ(failure_of(scratch / "b.umbel"), ErrorCode::kCorrupt);
}

TEST(AssetVersions, a_gigabyte_opens_with_less_than_a_megabyte) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch);
  const size_t old_end = get(whole, 24, 8);
  constexpr uint32_t kBytes = 40 << 10, kPages = (uint32_t{1} << 30) / kBytes + 1;
  std::vector<char> bytes = with_room(whole, old_end, size_t{24} * kPages);
  const size_t header_end = get(bytes, 24, 8);
  bytes.resize(header_end);
  // So many full pages of one group each, all of the first mesh's.
  const size_t meshes = get(bytes, entry_of(bytes, 3) + 8, 8);
  put(bytes, meshes + 80, 4, kPages - get(bytes, meshes + 88 + 80, 4));
  for (size_t i = 0; i < kPages; ++i) {
    put(bytes, old_end + 24 * i, 8, header_end + i * kBytes);
    put(bytes, old_end + 24 * i + 8, 4, kBytes);
    put(bytes, old_end + 24 * i + 12, 4, 1);
  }
  const size_t pages = entry_of(bytes, kPageSection), files = entry_of(bytes, kFileSection);
  put(bytes, pages + 8, 8, old_end);
  put(bytes, pages + 16, 8, size_t{24} * kPages);
  put(bytes, pages + 24, 8, kPages);
  put(bytes, files + 16, 8, 0);
  put(bytes, files + 24, 8, 0);
  const size_t nodes = entry_of(bytes, kNodeSection);
  const uint64_t size = header_end + uint64_t{kPages} * kBytes + get(bytes, nodes + 16, 8);
  put(bytes, nodes + 8, 8, size - get(bytes, nodes + 16, 8));
  put(bytes, 16, 8, size);
  repair_checksums(bytes);
  const auto source = std::make_shared<Beginning>(std::as_bytes(std::span(bytes)), size);
  const Asset asset(source);
  EXPECT_GT(asset.info().file_bytes, uint64_t{1} << 30);
  EXPECT_EQ(asset.info().pages, kPages);
  EXPECT_EQ(source->touched, header_end);
  EXPECT_LT(source->touched, 1'000'000u);
}

}  // namespace
}  // namespace umbel
