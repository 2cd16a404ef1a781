// Tables of pages and nodes that are read in slices.
#include <gtest/gtest.h>

#include <cstring>

#include "asset/beginning.hpp"
#include "asset/edit_file.hpp"
#include "asset/file/format.hpp"
#include "asset/file/page.hpp"
#include "asset/scratch.hpp"

namespace umbel {
namespace {

using testing::Beginning;
using testing::failure_of;
using testing::read_bytes;
using testing::Scratch;
using testing::small_asset;
using testing::write_bytes;

/// The file as it were if its tables were long enough for slices.
std::vector<char> with_slices(const std::vector<char>& whole) {
  const std::span file = std::as_bytes(std::span(whole));
  const auto opening = asset::opening_bytes_in(file.first(128), file.size());
  asset::FileHeader header = asset::decode_header(file.first(opening));
  header.has_page_slices = true;
  const auto nodes = file.subspan(header.nodes.offset, header.nodes.count * asset::kNodeBytes);
  header.nodes.slices = asset::slice_checksums(nodes, asset::kNodeBytes);
  const uint64_t more = asset::header_bytes(header) - opening;
  for (asset::PageEntry& page : header.pages) page.offset += more;
  for (asset::FileEntry& embedded : header.files) embedded.offset += more;
  header.nodes.offset += more;
  header.info.file_bytes += more;
  const std::vector<std::byte> made = asset::encode_header(header);
  std::vector<char> bytes(made.size());
  std::memcpy(bytes.data(), made.data(), made.size());
  bytes.insert(bytes.end(), whole.begin() + static_cast<ptrdiff_t>(opening), whole.end());
  return bytes;
}

TEST(AssetSlices, say_the_same) {
  const Scratch scratch;
  const std::vector<char> whole = small_asset(scratch, {1, 2, 3}, "{\"nodes\": []}");
  const Asset known(scratch / "whole.umbel");
  const std::vector<char> bytes = with_slices(whole);
  EXPECT_NE(bytes, whole);
  write_bytes(scratch / "b.umbel", bytes);
  const Asset asset(scratch / "b.umbel");
  EXPECT_EQ(failure_of(scratch / "b.umbel"), std::nullopt);
  EXPECT_EQ(asset.info().pages, known.info().pages);
  EXPECT_EQ(asset.info().metadata, known.info().metadata);
  EXPECT_EQ(asset.info().origin, known.info().origin);
  EXPECT_EQ(asset.scene(), known.scene());
  for (uint32_t p = 0; p < known.info().pages; ++p)
    EXPECT_EQ(asset.page_bytes(p), known.page_bytes(p));
  for (uint32_t m = 0; m < 2; ++m) {
    EXPECT_EQ(asset.tables(m).nodes, known.tables(m).nodes);
    EXPECT_EQ(asset.nodes(m), known.nodes(m));
    EXPECT_EQ(asset.tables(m).groups, known.tables(m).groups);
  }
  EXPECT_TRUE(asset.header_is_whole());
  EXPECT_TRUE(verify_asset(asset, 4).problems.empty());
  EXPECT_TRUE(verify_asset_within(1 << 30, asset, 4).problems.empty());
}

TEST(AssetSlices, notice_any_byte_that_is_changed) {
  const Scratch scratch;
  const std::vector<char> whole = with_slices(small_asset(scratch));
  write_bytes(scratch / "b.umbel", whole);
  ASSERT_EQ(failure_of(scratch / "b.umbel"), std::nullopt);
  const auto fails = [&](const std::filesystem::path& path) {
    const auto failure = failure_of(path);
    if (failure) return *failure == ErrorCode::kCorrupt;
    return !Asset(path).header_is_whole();  // padding behind the table of pages
  };
  for (size_t at = 0; at < whole.size(); ++at) {
    std::vector<char> bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x40);
    write_bytes(scratch / "b.umbel", bytes);
    ASSERT_TRUE(fails(scratch / "b.umbel")) << "byte " << at;
    const auto report = verify_asset(scratch / "b.umbel", 0);
    ASSERT_GE(report.checksum_errors, 1u) << "byte " << at;
  }
}

TEST(AssetSlices, are_written_for_long_tables_and_no_others) {
  const Scratch scratch;
  const auto sections = [&](const lod::Dag& dag) {
    AssetConfig config = AssetConfig::exact();
    config.page_bytes = 4096;
    write_asset(scratch / "a.umbel", dag, "{}", {}, config);
    return testing::get(read_bytes(scratch / "a.umbel"), 40, 4);
  };
  EXPECT_EQ(sections(testing::synthetic_dag(shapes::sphere(3), {8, 2})), 10u);
  // Over 4096 groups of a page each, whose one root refers to all of them.
  const Mesh mesh = testing::with_attributes(shapes::grid(512, 520));
  const lod::Dag large = testing::synthetic_dag(mesh, {128, 1});
  ASSERT_GT(large.tables.groups.size(), 4100u);
  EXPECT_EQ(sections(large), 12u);
  const Asset asset(scratch / "a.umbel");
  EXPECT_GT(asset.info().pages, 4096u);
  EXPECT_EQ(asset.nodes(), large.tables.nodes);
  EXPECT_EQ(asset.tables().groups, large.tables.groups);
  std::vector<char> bytes = read_bytes(scratch / "a.umbel");
  const size_t second = testing::get(bytes, 56, 8) + 24 * 4096 + 5;  // in the second slice
  bytes[second] ^= 1;
  write_bytes(scratch / "b.umbel", bytes);
  const Asset damaged(scratch / "b.umbel");
  EXPECT_EQ(damaged.read_page(4095).index, 4095u);
  EXPECT_THROW(damaged.read_page(4096), Error);
}

TEST(AssetSlices, a_terabyte_opens_with_a_few_kilobytes) {
  constexpr uint32_t kPages = 4'000'000, kBytes = 256 << 10;
  asset::FileHeader header;
  header.has_page_slices = true;
  header.info.page_bytes = kBytes;
  header.attributes =
      asset::make_format({{asset::kPositions, asset::Coding::kFloats, 0, 0}}).attributes;
  asset::MeshEntry mesh;
  mesh.attributes = {0, 1};
  mesh.mesh.groups = kPages;
  header.meshes = {mesh};
  header.pages.resize(kPages);
  header.nodes = {0, 0, asset::kNodeBytes, 0, {}};
  uint64_t at = asset::header_bytes(header);
  const uint64_t begin = at;
  for (asset::PageEntry& page : header.pages) {
    page = {at, kBytes, 1, 7};
    at += kBytes;
  }
  header.info.file_bytes = header.nodes.offset = at;
  const auto source = std::make_shared<Beginning>(asset::encode_header(header), at);
  const Asset opened(source);
  EXPECT_EQ(opened.info().pages, kPages);
  EXPECT_LT(source->touched, 20'000u);
  EXPECT_EQ(opened.page_bytes(kPages - 1), kBytes);
  EXPECT_LT(source->touched, 20'000u + 24 * asset::kSliceEntries + 1);
  EXPECT_GT(begin, uint64_t{24} * kPages);
}

TEST(PageBytes, grow_with_the_file) {
  EXPECT_EQ(asset::page_bytes_for(0), 40u << 10);
  EXPECT_EQ(asset::page_bytes_for(4'000'000'000), 40u << 10);
  EXPECT_EQ(asset::page_bytes_for(4'000'000'001), 64u << 10);
  EXPECT_EQ(asset::page_bytes_for(16'000'000'001), 256u << 10);
  const Scratch scratch;
  write_asset(scratch / "a.umbel", testing::synthetic_dag(shapes::sphere(2)));
  EXPECT_EQ(Asset(scratch / "a.umbel").info().page_bytes, 40u << 10);
}

}  // namespace
}  // namespace umbel
