// The table of coarse groups, by which walks read little more than the pages of their cut.
#include <gtest/gtest.h>

#include <cstring>

#include "asset/edit_file.hpp"
#include "asset/file/coarse_groups.hpp"
#include "asset/scratch.hpp"
#include "base/hash.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::read_bytes;
using testing::Scratch;
using testing::write_bytes;

/// What is known of an asset's coarse groups from its pages.
std::vector<std::byte> table_of(const Asset& asset, const asset::FileHeader& header) {
  std::vector<std::byte> table;
  for (uint32_t m = 0; m < header.meshes.size(); ++m) {
    std::vector<std::vector<std::byte>> rows(header.meshes[m].mesh.groups);
    for (uint32_t p = 0; p < asset.info().pages; ++p)
      for (const PageGroup& group : asset.read_page(p).groups)
        if (group.mesh == m)
          asset::append_coarse({group.id, p, group.parents, group.group.sphere, group.group.error},
                               asset::refinement_of(group.clusters, group.children),
                               rows[group.id]);
    const uint32_t first = asset::first_coarse(header, header.meshes[m]);
    asset::append_first(first, table);
    for (uint32_t g = first; g < rows.size(); ++g)
      table.insert(table.end(), rows[g].begin(), rows[g].end());
  }
  return table;
}

/// The file as if it were large enough for the table.
std::vector<char> with_table(const std::filesystem::path& path,
                             const std::function<void(std::vector<std::byte>&)>& change = {}) {
  const std::vector<char> whole = read_bytes(path);
  const std::span file = std::as_bytes(std::span(whole));
  const auto opening = asset::opening_bytes_in(file.first(128), file.size());
  asset::FileHeader header = asset::decode_header(file.first(opening));
  std::vector<std::byte> table = table_of(Asset(path), header);
  if (change) change(table);
  header.coarse.count = table.size() / asset::kCoarseBytes;
  const uint64_t more = asset::header_bytes(header) - opening;
  for (asset::PageEntry& page : header.pages) page.offset += more;
  header.nodes.offset += more;
  header.coarse = {file.size() + more,
                   table.size() / asset::kCoarseBytes,
                   asset::kCoarseBytes,
                   xxh64(table.data(), table.size()),
                   {}};
  header.info.file_bytes = header.coarse.offset + table.size();
  const std::vector<std::byte> made = asset::encode_header(header);
  std::vector<char> bytes(made.size());
  std::memcpy(bytes.data(), made.data(), made.size());
  bytes.insert(bytes.end(), whole.begin() + static_cast<ptrdiff_t>(opening), whole.end());
  const auto* rows = reinterpret_cast<const char*>(table.data());
  bytes.insert(bytes.end(), rows, rows + table.size());
  return bytes;
}

void write_small(const std::filesystem::path& path, const Mesh& mesh, uint32_t page_bytes = 8192) {
  AssetConfig config;
  config.page_bytes = page_bytes;
  write_asset(path, lod::build(mesh.view(), lod::testing::small_config()), "{}", {}, config);
}

std::vector<lod::View> views_of(const lod::Tables& tables) {
  std::vector<lod::View> views{lod::view_error(0)};
  lod::testing::Random random(5);
  for (uint32_t level = 0; level <= tables.levels.size(); ++level)
    views.push_back(lod::view_level(level));
  for (int i = 0; i < 30; ++i) {
    const float error = tables.groups[random.below(uint32_t(tables.groups.size()))].error;
    if (std::isfinite(error)) views.push_back(lod::view_error(error));
    views.push_back(lod::testing::random_camera(random, tables, {}));
  }
  return views;
}

std::vector<uint32_t> ids_of(const std::vector<CutCluster>& cut) {
  std::vector<uint32_t> ids;
  for (const CutCluster& cluster : cut) ids.push_back(cluster.id);
  return ids;
}

TEST(CoarseGroups, give_the_same_cuts_by_fewer_pages) {
  const Scratch scratch;
  uint64_t pages = 0, pages_without = 0;
  for (const Mesh& mesh : {shapes::blob(5, 1), shapes::terrain(64, 64, 2), shapes::soup(2000, 3),
                           shapes::moebius(300, 8), shapes::tetrahedra(600)}) {
    write_small(scratch / "a.umbel", mesh);
    write_bytes(scratch / "b.umbel", with_table(scratch / "a.umbel"));
    const Asset plain(scratch / "a.umbel"), asset(scratch / "b.umbel");
    const lod::Tables& tables = asset.tables();
    const std::vector<std::vector<Plane>> frusta{{}, {{{1, 0, 0}, 0.1f}, {{0, 1, 0}, 0}}};
    for (const lod::View& view : views_of(tables))
      for (const std::vector<Plane>& planes : frusta) {
        WalkReport report, without;
        ASSERT_EQ(ids_of(clusters_of_cut(asset, view, 0, planes, &report)),
                  lod::select(tables, view, {planes, {}}));
        clusters_of_cut(plain, view, 0, planes, &without);
        EXPECT_EQ(report.triangles, without.triangles);
        EXPECT_EQ(report.error, without.error);
        EXPECT_EQ(report.cut_pages, without.cut_pages);
        EXPECT_LE(report.pages, without.pages);
        pages += report.pages;
        pages_without += without.pages;
      }
    for (const uint64_t most : {1u, 100u, 1000u, 2500u, 100000u})
      EXPECT_EQ(view_for_triangles(asset, lod::view_error(0), most).error,
                view_for_triangles(plain, lod::view_error(0), most).error);
  }
  EXPECT_LT(pages, pages_without);
}

TEST(CoarseGroups, are_written_to_large_files) {
  const Scratch scratch;
  write_small(scratch / "small.umbel", shapes::blob(5, 1), 4096);
  const Asset small(scratch / "small.umbel");
  ASSERT_LT(small.info().pages, asset::kLeastCoarsePages);
  EXPECT_EQ(small.refinement(small.roots().front().group), nullptr);
  write_small(scratch / "a.umbel", shapes::terrain(420, 420, 2), 4096);
  const Asset large(scratch / "a.umbel");
  ASSERT_GE(large.info().pages, asset::kLeastCoarsePages);
  const Range third = large.levels()[2];
  EXPECT_NE(large.refinement(third.offset), nullptr);
  EXPECT_EQ(large.refinement(third.offset - 1), nullptr);
  EXPECT_NE(large.refinement(large.roots().front().group), nullptr);
  EXPECT_EQ(large.refinement(large.meshes().front().groups), nullptr);
  EXPECT_THROW(large.refinement(0, 1), Error);
  EXPECT_TRUE(verify_asset(large, 4).ok);
  EXPECT_TRUE(verify_asset_within(1 << 30, large, 4).ok);
  for (uint32_t level = 0; level < large.levels().size(); ++level) {
    const WalkReport report = large.walk(lod::view_level(level), [](const CutGroup&) {});
    EXPECT_LE(report.pages, 2 * report.cut_pages) << "level " << level;
  }
}

TEST(CoarseGroups, that_are_damaged_are_noticed) {
  const Scratch scratch;
  write_small(scratch / "a.umbel", shapes::blob(5, 1));
  const std::vector<char> whole = with_table(scratch / "a.umbel");
  const std::filesystem::path path = scratch / "b.umbel";
  const size_t table = read_bytes(scratch / "a.umbel").size();
  ASSERT_GT(whole.size(), table + 400);
  for (size_t at = whole.size() - 400; at < whole.size(); at += 7) {
    std::vector<char> bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x10);
    write_bytes(path, bytes);
    EXPECT_THROW(Asset(path).walk(lod::view_error(0), [](const CutGroup&) {}), Error);
    EXPECT_GE(verify_asset(path, 0).checksum_errors, 1u);
    EXPECT_GE(verify_asset_within(1 << 30, path, 0).checksum_errors, 1u);
  }
}

TEST(CoarseGroups, that_are_not_what_pages_say_are_noticed) {
  const Scratch scratch;
  write_small(scratch / "a.umbel", shapes::blob(5, 1));
  const std::filesystem::path path = scratch / "b.umbel";
  // Of the first mesh, of its first group, and of that group's first reference.
  for (const size_t word : {0, 10, 18, 19, 20, 21, 22, 23, 27, 28, 29})
    for (const unsigned change : {1u, 0x80000000u}) {
      write_bytes(path, with_table(scratch / "a.umbel", [&](std::vector<std::byte>& bytes) {
                    uint32_t value;
                    std::memcpy(&value, &bytes[4 * word], 4);
                    value ^= change;
                    std::memcpy(&bytes[4 * word], &value, 4);
                  }));
      EXPECT_FALSE(verify_asset(path, 0).ok) << word;
      EXPECT_FALSE(verify_asset_within(1 << 30, path, 0).ok) << word;
    }
  const auto cut = [](std::vector<std::byte>& bytes) { bytes.resize(bytes.size() - 40); };
  write_bytes(path, with_table(scratch / "a.umbel", cut));
  EXPECT_THROW(Asset(path).refinement(0), Error);
  const auto more = [](std::vector<std::byte>& bytes) { bytes.resize(bytes.size() + 40); };
  write_bytes(path, with_table(scratch / "a.umbel", more));
  EXPECT_THROW(Asset(path).refinement(0), Error);
}

}  // namespace
}  // namespace umbel
