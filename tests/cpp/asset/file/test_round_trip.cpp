#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "asset/same_geometry.hpp"
#include "asset/scratch.hpp"
#include "asset/synthetic_dag.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using testing::read_bytes;
using testing::Scratch;
using testing::synthetic_dag;
using testing::triangles_of;
using testing::with_attributes;

void expect_round_trip(const lod::Dag& dag) {
  const Scratch scratch;
  const uint64_t bytes =
      write_asset(scratch / "a.umbel", dag, "{\"name\": \"a\"}", {}, AssetConfig::exact());
  const Asset asset(scratch / "a.umbel");
  EXPECT_EQ(asset.info().file_bytes, bytes);
  EXPECT_EQ(std::filesystem::file_size(scratch / "a.umbel"), bytes);
  EXPECT_EQ(asset.info().metadata, "{\"name\": \"a\"}");
  ASSERT_EQ(asset.meshes().size(), 1u);
  EXPECT_EQ(asset.meshes()[0].groups, dag.tables.groups.size());
  EXPECT_EQ(asset.meshes()[0].clusters, dag.tables.clusters.size());
  EXPECT_EQ(asset.info().source_digest, dag.source_digest);
  EXPECT_EQ(asset.info().source_triangles, dag.report.input_triangles);
  EXPECT_EQ(asset.info().source_vertices, dag.report.input_vertices);
  EXPECT_EQ(asset.info().max_triangles, dag.config.max_triangles);
  EXPECT_EQ(asset.info().max_vertices, dag.config.max_vertices);
  EXPECT_EQ(asset.info().normals, !dag.vertices.normals.empty());
  EXPECT_EQ(asset.info().colors, !dag.vertices.colors.empty());
  EXPECT_EQ(asset.tables().levels, dag.tables.levels);
  EXPECT_EQ(asset.tables().groups, dag.tables.groups);
  testing::expect_same_clusters(asset.tables().clusters, dag.tables.clusters);
  EXPECT_EQ(asset.tables().nodes, dag.tables.nodes);
  for (uint32_t p = 0; p < asset.info().pages; ++p) EXPECT_TRUE(asset.page_is_whole(p));
  for (uint32_t c = 0; c < dag.tables.clusters.size(); ++c)
    EXPECT_TRUE(triangles_of(asset.geometry(c)) == triangles_of(dag.geometry(c))) << c;
}

TEST(AssetRoundTrip, gives_back_positions_exactly) {
  expect_round_trip(synthetic_dag(shapes::blob(3, 1)));
}

TEST(AssetRoundTrip, gives_back_every_attribute_exactly) {
  expect_round_trip(synthetic_dag(with_attributes(shapes::terrain(20, 20, 1))));
  for (int stream = 0; stream < 4; ++stream) {
    Mesh mesh = with_attributes(shapes::torus(12, 8));
    if (stream != 0) mesh.normals.clear();
    if (stream != 1) mesh.tangents.clear();
    if (stream != 2) mesh.uvs.clear();
    if (stream != 3) mesh.colors.clear();
    expect_round_trip(synthetic_dag(mesh));
  }
}

TEST(AssetRoundTrip, gives_back_nothing_for_nothing) { expect_round_trip(synthetic_dag(Mesh{})); }

TEST(AssetRoundTrip, gives_back_one_triangle) { expect_round_trip(synthetic_dag(shapes::fan(1))); }

TEST(AssetRoundTrip, spans_many_batches_of_pages) {
  expect_round_trip(synthetic_dag(with_attributes(shapes::blob(6, 1)), {100, 30}));
}

TEST(AssetRoundTrip, gives_the_same_bytes_on_any_thread_count_and_run) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(with_attributes(shapes::blob(6, 1)), {100, 30});
  std::vector<char> first;
  for (uint32_t threads : {1u, 2u, 4u, 1u}) {
    BuildOptions options;
    options.threads = threads;
    write_asset(scratch / "a.umbel", dag, "{}", options);
    const std::vector<char> bytes = read_bytes(scratch / "a.umbel");
    if (first.empty()) first = bytes;
    EXPECT_TRUE(bytes == first) << threads;
  }
}

TEST(AssetRoundTrip, can_be_read_from_many_threads_and_moved) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::blob(4, 1));
  write_asset(scratch / "a.umbel", dag);
  Asset opened(scratch / "a.umbel");
  const Asset asset = std::move(opened);
  std::vector<std::thread> threads;
  std::atomic<size_t> right{0};
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (uint32_t c = 0; c < dag.tables.clusters.size(); ++c)
        right += triangles_of(asset.geometry(c)) == triangles_of(dag.geometry(c));
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 4 * dag.tables.clusters.size());
}

TEST(AssetRoundTrip, stores_the_coarsest_level_first_and_parents_before_children) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::blob(5, 1), {64, 8});
  AssetConfig config;
  config.page_bytes = 16384;
  write_asset(scratch / "a.umbel", dag, "{}", {}, config);
  const Asset asset(scratch / "a.umbel");
  ASSERT_GT(asset.info().pages, 4u);
  uint32_t level = 1;
  std::vector<uint32_t> page_of(dag.tables.groups.size(), kNone);
  for (uint32_t p = 0; p < asset.info().pages; ++p) {
    const AssetPage page = asset.read_page(p);
    EXPECT_EQ(page.bytes.size(), asset.page_bytes(p));
    EXPECT_TRUE(page.groups.size() == 1 || page.bytes.size() <= config.page_bytes);
    for (const PageGroup& group : page.groups) {
      EXPECT_LE(group.group.level, level);
      level = group.group.level;
      EXPECT_EQ(page_of[group.id], kNone);
      page_of[group.id] = p;
    }
  }
  for (const GroupRef& root : asset.roots()) {
    EXPECT_EQ(root.parents, 0u);
    EXPECT_EQ(root.page, page_of[root.group]);
  }
  for (uint32_t p = 0; p < asset.info().pages; ++p)
    for (const PageGroup& group : asset.read_page(p).groups)
      for (const GroupRef& child : group.children) {
        EXPECT_EQ(child.page, page_of[child.group]);
        EXPECT_GE(child.page, p);
      }
}

TEST(AssetRoundTrip, gives_several_meshes_with_instances_materials_and_files) {
  const Scratch scratch;
  const lod::Dag first = synthetic_dag(shapes::blob(3, 1), {64, 4});
  const lod::Dag second = synthetic_dag(with_attributes(shapes::torus(12, 8)));
  const lod::Dag nothing = synthetic_dag(Mesh{});
  AssetContents contents;
  contents.meshes = {&first, &nothing, &second};
  contents.instances = {{2, {2, 0, 0, 1, 0, 2, 0, 2, 0, 0, 2, 3}}, {0}, {2}};
  contents.materials = "{\"materials\": [{}]}";
  contents.files = {{std::byte{7}}, {}, {std::byte{1}, std::byte{2}}};
  write_asset(scratch / "a.umbel", contents, {}, AssetConfig::exact());
  const Asset asset(scratch / "a.umbel");
  EXPECT_EQ(asset.instances(), contents.instances);
  EXPECT_EQ(asset.materials(), contents.materials);
  ASSERT_EQ(asset.files(), 3u);
  for (uint32_t f = 0; f < 3; ++f) EXPECT_EQ(asset.file(f), contents.files[f]);
  ASSERT_EQ(asset.meshes().size(), 3u);
  EXPECT_EQ(asset.info().source_triangles,
            first.report.input_triangles + second.report.input_triangles);
  for (uint32_t m = 0; m < 3; ++m) {
    const lod::Dag& dag = *contents.meshes[m];
    EXPECT_EQ(asset.tables(m).groups, dag.tables.groups);
    EXPECT_EQ(asset.tables(m).nodes, dag.tables.nodes);
    EXPECT_EQ(asset.tables(m).levels, dag.tables.levels);
    EXPECT_EQ(asset.meshes()[m].source_digest, dag.source_digest);
    for (uint32_t c = 0; c < dag.tables.clusters.size(); ++c)
      EXPECT_TRUE(triangles_of(asset.geometry(c, m)) == triangles_of(dag.geometry(c))) << m;
  }
  EXPECT_TRUE(asset.roots(1).empty());
  EXPECT_THROW(asset.roots(3), Error);
  EXPECT_THROW(asset.tables(3), Error);
  EXPECT_THROW(asset.file(3), Error);
}

TEST(AssetRoundTrip, refuses_contents_that_do_not_fit_together) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::fan(3));
  AssetContents contents;
  contents.meshes = {&dag};
  contents.instances = {{1}};
  EXPECT_THROW(write_asset(scratch / "a.umbel", contents), Error);
  contents.instances = {{0, {std::numeric_limits<float>::infinity()}}};
  EXPECT_THROW(write_asset(scratch / "a.umbel", contents), Error);
  contents.instances.clear();
  contents.meshes.push_back(nullptr);
  EXPECT_THROW(write_asset(scratch / "a.umbel", contents), Error);
  for (const uint32_t bytes : {100u, 5000u, 0xfffff000u}) {
    AssetConfig config;
    config.page_bytes = bytes;
    EXPECT_THROW(write_asset(scratch / "a.umbel", dag, "{}", {}, config), Error) << bytes;
  }
  EXPECT_EQ(scratch.files(), 0u);
}

TEST(AssetRoundTrip, refuses_indices_that_do_not_exist) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::sphere(1));
  write_asset(scratch / "a.umbel", dag);
  const Asset asset(scratch / "a.umbel");
  EXPECT_THROW(asset.geometry(static_cast<uint32_t>(dag.tables.clusters.size())), Error);
  EXPECT_THROW(asset.page_is_whole(asset.info().pages), Error);
  EXPECT_THROW(asset.geometry(kNone), Error);
}

}  // namespace
}  // namespace umbel
