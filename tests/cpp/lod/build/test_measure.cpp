// Config::measured_error: what a group promises is kept, measured by other samples than its own.
#include <gtest/gtest.h>

#include "../../../../bench/ply_reader.hpp"
#include "base/math.hpp"
#include "data_folder.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/lod.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::lod {
namespace {

using testing::Random;

// The largest distance from `count` random points of one surface to the other.
float farthest(const Mesh& from, const Bvh& to, size_t count, Random& random) {
  std::vector<double> areas{0};
  for (const Triangle& t : from.triangles)
    areas.push_back(areas.back() + length(cross(from.positions[t[1]] - from.positions[t[0]],
                                                from.positions[t[2]] - from.positions[t[0]])));
  float result = 0;
  for (size_t i = 0; i < count; ++i) {
    const double at = random.uniform() * areas.back();
    const size_t t = std::upper_bound(areas.begin(), areas.end(), at) - areas.begin() - 1;
    const Triangle& triangle = from.triangles[std::min(t, from.triangles.size() - 1)];
    float u = static_cast<float>(random.uniform()), v = static_cast<float>(random.uniform());
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3 p = from.positions[triangle[0]] * (1 - u - v) + from.positions[triangle[1]] * u +
                   from.positions[triangle[2]] * v;
    result = std::max(result, to.closest_point(p).distance);
  }
  return result;
}

// From the vertices of one surface to the other.
float farthest_vertex(const Mesh& from, const Bvh& to) {
  float result = 0;
  for (const Vec3& p : from.positions) result = std::max(result, to.closest_point(p).distance);
  return result;
}

Config measured_config() {
  Config config;
  config.measured_error = true;
  return config;
}

void expect_bounded(const Mesh& mesh) {
  const Dag dag = build(mesh.view(), measured_config());
  const Bvh source = Bvh::build(mesh.view());
  Random random(4);
  size_t coarse = 0;
  for (uint32_t level = 1; level < dag.tables.levels.size(); level += 2) {
    const std::vector<uint32_t> cut = select(dag.tables, view_level(level));
    const Mesh shown = mesh_of_cut(dag.tables, testing::reader_of(dag), cut);
    const Bvh bvh = Bvh::build(shown.view());
    const float error = cut_error(dag.tables, cut) + 1e-6f;  // what rounds where all is flat
    EXPECT_LE(farthest(shown, source, 3000, random), error) << "level " << level;
    EXPECT_LE(farthest(mesh, bvh, 3000, random), error) << "level " << level;
    EXPECT_LE(farthest_vertex(mesh, bvh), error) << "level " << level;
    ++coarse;
  }
  EXPECT_GT(coarse, 2u);
  EXPECT_GT(dag.report.measured_groups, 10u);
}

TEST(MeasuredError, bounds_the_distance_of_cuts_to_the_source) {
  expect_bounded(shapes::blob(6, 3));
  expect_bounded(shapes::terrain(150, 150, 2));
}

// Whatever vertices a level takes as samples: a spike counts once it goes.
TEST(MeasuredError, misses_no_spike_of_many) {
  for (const uint32_t apart : {4u, 7u, 16u}) {
    Mesh mesh = shapes::grid(96, 96);
    for (uint32_t v = 0; v < mesh.positions.size(); v += apart)
      mesh.positions[v] = mesh.positions[v] + Vec3{0.0f, 0.0f, 0.02f};
    expect_bounded(mesh);
  }
}

TEST(MeasuredError, bounds_the_distance_on_real_meshes) {
  for (const char* name : {"bunny_69k.ply", "horse_97k.ply"}) {
    const std::filesystem::path path = umbel::testing::data_folder() / name;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "needs the real meshes";
    expect_bounded(bench::read_ply(path.string()));
  }
}

TEST(MeasuredError, is_monotone_and_verified) {
  const Mesh mesh = shapes::blob(5, 2);
  Config config = testing::small_config();
  config.measured_error = true;
  const Dag dag = build(mesh.view(), config);
  const VerifyReport report =
      verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh));
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
}

TEST(MeasuredError, is_smaller_than_the_sum_of_steps_on_the_whole) {
  const Mesh mesh = shapes::blob(6, 3);
  const Dag dag = build(mesh.view(), measured_config());
  EXPECT_GT(dag.report.mean_log2_overestimate, 0.0);
  EXPECT_LT(error_for_triangles(dag.tables, 2000),
            error_for_triangles(build(mesh.view()).tables, 2000));
}

TEST(MeasuredError, does_not_depend_on_threads) {
  const Mesh mesh = shapes::blob(5, 8);
  BuildOptions one, many;
  one.threads = 1;
  many.threads = 8;
  const Dag a = build(mesh.view(), measured_config(), one);
  const Dag b = build(mesh.view(), measured_config(), many);
  EXPECT_EQ(a.tables.groups, b.tables.groups);
  EXPECT_EQ(a.report.mean_log2_overestimate, b.report.mean_log2_overestimate);
}

TEST(StopCriteria, levels_are_capped) {
  const Mesh mesh = shapes::blob(5, 2);
  for (const uint32_t levels : {1u, 2u, 4u}) {
    Config config = testing::small_config();
    config.max_levels = levels;
    const Dag dag = build(mesh.view(), config);
    EXPECT_EQ(dag.tables.levels.size(), levels);
    EXPECT_EQ(dag.report.stuck_groups, 0u);
    EXPECT_GT(dag.report.root_groups, 1u);
    const VerifyReport report =
        verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh));
    EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
  }
}

TEST(StopCriteria, building_stops_at_a_number_of_triangles) {
  const Mesh mesh = shapes::blob(5, 2);
  Config config = testing::small_config();
  config.stop_triangles = 3000;
  const Dag dag = build(mesh.view(), config);
  EXPECT_LE(dag.report.root_triangles, 3000u);
  EXPECT_GT(dag.report.root_triangles, 1000u);
  EXPECT_EQ(dag.report.stuck_groups, 0u);
}

TEST(StopCriteria, no_group_gets_a_larger_error) {
  const Mesh mesh = shapes::blob(5, 2);
  for (const bool measured : {false, true}) {
    Config config = testing::small_config();
    config.max_error = 0.03f;
    config.measured_error = measured;
    const Dag dag = build(mesh.view(), config);
    EXPECT_GT(dag.tables.levels.size(), 2u);
    EXPECT_GT(dag.report.root_triangles, config.max_triangles);
    EXPECT_EQ(dag.report.stuck_groups, 0u);
    for (const Group& group : dag.tables.groups)
      if (group.method != SimplifyMethod::kRoot) EXPECT_LE(group.error, 0.03f);
    const VerifyReport report =
        verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh));
    EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
  }
}

TEST(StopCriteria, impossible_ones_are_rejected) {
  Config config;
  config.max_error = -1;
  EXPECT_THROW(build(shapes::grid(2, 2).view(), config), Error);
  config.max_error = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(build(shapes::grid(2, 2).view(), config), Error);
}

// Down to where a group is a few steps of the smallest float.
TEST(MeasuredError, is_a_distance_at_any_size) {
  const Mesh mesh = shapes::blob(4, 2);
  for (const float scale : {1e-44f, 1e-40f, 1e-30f, 1e17f}) {
    Mesh scaled = mesh;
    for (Vec3& p : scaled.positions) p = p * scale;
    const Dag dag = build(scaled.view(), measured_config());
    for (const Group& group : dag.tables.groups) EXPECT_GE(group.error, 0.0f) << scale;
    const VerifyConfig config = testing::verify_config_of(dag, scaled, 8);
    EXPECT_TRUE(verify(dag.tables, testing::reader_of(dag), config).ok) << scale;
  }
}

}  // namespace
}  // namespace umbel::lod
