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
  EXPECT_EQ(asset.info().pages, dag.tables.groups.size());
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
  for (uint32_t g = 0; g < dag.tables.groups.size(); ++g) EXPECT_TRUE(asset.page_is_whole(g));
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

TEST(AssetRoundTrip, stores_the_coarsest_level_first) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::blob(3, 1));
  write_asset(scratch / "a.umbel", dag);
  // Damage near the end is damage to the finest level, and the root's page is untouched.
  std::vector<char> bytes = read_bytes(scratch / "a.umbel");
  bytes[bytes.size() - 100] ^= 1;
  testing::write_bytes(scratch / "b.umbel", bytes);
  const Asset asset(scratch / "b.umbel");
  const auto groups = static_cast<uint32_t>(dag.tables.groups.size());
  EXPECT_TRUE(asset.page_is_whole(groups - 1));
  EXPECT_FALSE(asset.page_is_whole(groups - 2));
}

TEST(AssetRoundTrip, refuses_indices_that_do_not_exist) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::sphere(1));
  write_asset(scratch / "a.umbel", dag);
  const Asset asset(scratch / "a.umbel");
  EXPECT_THROW(asset.geometry(static_cast<uint32_t>(dag.tables.clusters.size())), Error);
  EXPECT_THROW(asset.page_is_whole(static_cast<uint32_t>(dag.tables.groups.size())), Error);
  EXPECT_THROW(asset.geometry(kNone), Error);
}

}  // namespace
}  // namespace umbel
