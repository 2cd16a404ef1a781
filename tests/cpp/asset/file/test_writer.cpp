#include <gtest/gtest.h>

#include <csignal>
#include <functional>

#include "asset/in_small_space.hpp"
#include "asset/same_geometry.hpp"
#include "asset/scratch.hpp"
#include "asset/synthetic_dag.hpp"
#include "umbel/asset.hpp"

#if defined(__unix__)
#include <sys/wait.h>
#include <unistd.h>
#endif

namespace umbel {
namespace {

namespace fs = std::filesystem;
using testing::read_bytes;
using testing::Scratch;
using testing::synthetic_dag;
using testing::write_bytes;

Error error_of(const fs::path& path, const lod::Dag& dag, const BuildOptions& options = {}) {
  try {
    write_asset(path, dag, "{}", options);
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorCode::kCancelled, "nothing was thrown");
}

TEST(WriteAsset, fills_its_pages) {
  const Scratch scratch;
  lod::Config config;
  config.position_step = 0x1p-14f;
  write_asset(scratch / "a.umbel", lod::build(shapes::blob(7, 1).view(), config));
  const Asset asset(scratch / "a.umbel");
  uint64_t used = 0, all = 0;
  for (uint32_t p = 0; p < asset.info().pages; ++p) {
    const AssetPage page = asset.read_page(p);
    all += page.bytes.size();
    used += page.groups.back().offset + page.groups.back().bytes;
  }
  EXPECT_GT(asset.info().pages, 30u);
  EXPECT_GT(static_cast<double>(used), 0.95 * static_cast<double>(all));
}

TEST(WriteAsset, leaves_only_the_file_itself) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", synthetic_dag(shapes::blob(3, 1)));
  EXPECT_EQ(scratch.files(), 1u);
}

TEST(WriteAsset, replaces_a_file_and_follows_a_link) {
  const Scratch scratch;
  write_bytes(scratch / "a.umbel", {'o', 'l', 'd'});
  fs::create_symlink("a.umbel", scratch / "link.umbel");
  write_asset(scratch / "link.umbel", synthetic_dag(shapes::blob(2, 1)));
  EXPECT_TRUE(fs::is_symlink(scratch / "link.umbel"));
  EXPECT_NO_THROW(Asset(scratch / "a.umbel"));
  EXPECT_EQ(scratch.files(), 2u);
}

TEST(WriteAsset, takes_the_longest_name_there_is) {
  const Scratch scratch;
  const std::string name = std::string(249, 'n') + ".umbel";
  write_asset(scratch / name, synthetic_dag(shapes::sphere(0)));
  EXPECT_NO_THROW(Asset(scratch / name));
}

TEST(WriteAsset, leaves_the_old_file_when_it_is_cancelled) {
  const Scratch scratch;
  write_bytes(scratch / "a.umbel", {'o', 'l', 'd'});
  BuildOptions options;
  float highest = 0;
  options.progress = [&](float fraction, std::string_view) {
    highest = std::max(highest, fraction);
    return fraction < 0.5f;
  };
  const Error error =
      error_of(scratch / "a.umbel", synthetic_dag(shapes::blob(7, 1), {100, 30}), options);
  EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  EXPECT_GE(highest, 0.5f);
  EXPECT_EQ(read_bytes(scratch / "a.umbel"), (std::vector<char>{'o', 'l', 'd'}));
  EXPECT_EQ(scratch.files(), 1u);
}

TEST(WriteAsset, says_why_it_cannot_write) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::sphere(1));
  const Error missing = error_of(scratch / "no_such_folder/a.umbel", dag);
  EXPECT_EQ(missing.code(), ErrorCode::kIo);
  EXPECT_NE(std::string(missing.what()).find("a.umbel"), std::string::npos);
  fs::create_directory(scratch / "folder.umbel");
  EXPECT_EQ(error_of(scratch / "folder.umbel", dag).code(), ErrorCode::kIo);
  EXPECT_TRUE(fs::is_directory(scratch / "folder.umbel"));
  if (fs::exists("/dev/full")) {
    EXPECT_EQ(error_of("/dev/full", dag).code(), ErrorCode::kIo);
    EXPECT_TRUE(fs::is_character_file("/dev/full"));
  }
}

#if defined(__unix__)

TEST(WriteAsset, that_runs_out_of_space_removes_what_it_wrote) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::blob(5, 1));
  EXPECT_TRUE(testing::in_small_space(100000, [&] {
    BuildOptions options;
    options.threads = 1;
    const Error error = error_of(scratch / "a.umbel", dag, options);
    return error.code() == ErrorCode::kIo && scratch.files() == 0;
  }));
  EXPECT_EQ(scratch.files(), 0u);
}

TEST(WriteAsset, that_is_killed_leaves_no_file_of_that_name_or_a_whole_one) {
  const Scratch scratch;
  const lod::Dag dag = synthetic_dag(shapes::blob(6, 1));
  for (useconds_t delay = 0; delay < 20000; delay += 1000) {
    const pid_t child = ::fork();
    if (child == 0) {
      BuildOptions options;
      options.threads = 1;
      write_asset(scratch / "a.umbel", dag, "{}", options);
      ::_exit(0);
    }
    ::usleep(delay);
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    if (!fs::exists(scratch / "a.umbel")) continue;
    EXPECT_EQ(verify_asset(scratch / "a.umbel", 0).checksum_errors, 0u);
    fs::remove(scratch / "a.umbel");
  }
}

#endif

// ---- what is refused, and what is not ---------------------------------------------------------

TEST(WriteAsset, refuses_what_is_structurally_impossible) {
  const Scratch scratch;
  const lod::Dag whole = synthetic_dag(shapes::blob(3, 1));
  const std::pair<const char*, std::function<void(lod::Dag&)>> changes[] = {
      {"level range", [](lod::Dag& d) { d.tables.levels[0].count = 10000; }},
      {"cluster range", [](lod::Dag& d) { d.tables.groups[1].clusters.offset = kNone; }},
      {"cluster in two groups", [](lod::Dag& d) { d.tables.groups[1].clusters.offset = 0; }},
      {"cluster in no group", [](lod::Dag& d) { d.tables.groups[1].clusters.count = 1; }},
      {"method",
       [](lod::Dag& d) { d.tables.groups[1].method = static_cast<lod::SimplifyMethod>(5); }},
      {"group", [](lod::Dag& d) { d.tables.clusters[3].group = 10000; }},
      {"group that it is not in", [](lod::Dag& d) { d.tables.clusters[0].group = 1; }},
      {"vertex count", [](lod::Dag& d) { d.tables.clusters[3].vertex_count = 65536; }},
      {"triangle count", [](lod::Dag& d) { d.tables.clusters[0].triangle_count = 1; }},
      {"no triangles", [](lod::Dag& d) { d.triangle_offsets[1] = 0; }},
      {"generating group", [](lod::Dag& d) { d.tables.clusters[3].generating_group = 10000; }},
      {"children", [](lod::Dag& d) { d.tables.nodes[0].children.count = 10000; }},
      {"cycle", [](lod::Dag& d) { d.tables.nodes[2].children = {2, 1}; }},
      {"root as child", [](lod::Dag& d) { d.tables.nodes[2].children = {0, 1}; }},
      {"leaf's group", [](lod::Dag& d) { d.tables.nodes[1].group = 10000; }},
      {"vertex offsets", [](lod::Dag& d) { d.vertex_offsets.pop_back(); }},
      {"falling offsets", [](lod::Dag& d) { d.vertex_offsets[2] = 0; }},
      {"triangle offsets", [](lod::Dag& d) { d.triangle_offsets.back() += 1; }},
      {"vertex", [](lod::Dag& d) { d.cluster_vertices[7] = 1u << 20; }},
      {"local vertex", [](lod::Dag& d) { d.cluster_triangles[7] = 255; }},
      {"stream", [](lod::Dag& d) { d.vertices.uvs.resize(3); }},
  };
  for (const auto& [name, change] : changes) {
    lod::Dag dag = whole;
    change(dag);
    EXPECT_EQ(error_of(scratch / "a.umbel", dag).code(), ErrorCode::kInvalidArgument) << name;
    EXPECT_EQ(scratch.files(), 0u) << name;
  }
}

TEST(WriteAsset, stores_what_is_merely_wrong) {
  const Scratch scratch;
  const lod::Dag whole = synthetic_dag(shapes::blob(3, 1));
  const std::pair<const char*, std::function<void(lod::Dag&)>> changes[] = {
      {"error lowered", [](lod::Dag& d) { d.tables.groups[1].error = -1; }},
      {"sphere shrunk", [](lod::Dag& d) { d.tables.groups[1].sphere.radius = 1e-3f; }},
      {"level", [](lod::Dag& d) { d.tables.groups[1].level = 9; }},
      {"method", [](lod::Dag& d) { d.tables.groups[1].method = lod::SimplifyMethod::kRoot; }},
      {"generating group", [](lod::Dag& d) { d.tables.clusters[0].generating_group = 1; }},
      {"node", [](lod::Dag& d) { d.tables.nodes[2].children.count = 1; }},
      {"triangle dropped", [](lod::Dag& d) {
         d.cluster_triangles.resize(d.cluster_triangles.size() - 3);
         --d.triangle_offsets.back();
         --d.tables.clusters.back().triangle_count;
       }}};
  for (const auto& [name, change] : changes) {
    lod::Dag dag = whole;
    change(dag);
    write_asset(scratch / "a.umbel", dag);
    const Asset asset(scratch / "a.umbel");
    EXPECT_EQ(asset.tables().groups, dag.tables.groups) << name;
    testing::expect_same_clusters(asset.tables().clusters, dag.tables.clusters);
    const auto last = static_cast<uint32_t>(dag.tables.clusters.size() - 1);
    EXPECT_TRUE(testing::triangles_of(asset.geometry(last)) ==
                testing::triangles_of(dag.geometry(last)))
        << name;
    const auto report = verify_asset(scratch / "a.umbel", 4);
    EXPECT_FALSE(report.ok) << name;
    EXPECT_EQ(report.checksum_errors, 0u) << name;
    EXPECT_FALSE(report.problems.empty()) << name;
  }
}

}  // namespace
}  // namespace umbel
