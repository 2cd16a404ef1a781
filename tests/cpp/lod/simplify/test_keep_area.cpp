// Many small parts cover as much in coarse levels as in fine ones.
#include <gtest/gtest.h>

#include "base/math.hpp"
#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

// Copies of `part`, turned at random and spread in a cube.
Mesh scattered(const Mesh& part, uint32_t count, float size) {
  testing::Random random(11);
  Mesh mesh;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 at = random.point(), d = random.point();
    const Vec3 x = d * (1.0f / length(d));
    const Vec3 c = cross(x, random.point());
    const Vec3 y = c * (1.0f / length(c)), z = cross(x, y);
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const Vec3& p : part.positions)
      mesh.positions.push_back(at + (x * p.x + y * p.y + z * p.z) * size);
    for (const Triangle& t : part.triangles)
      mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return mesh;
}

double area(const Mesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += 0.5 * double{length(cross(mesh.positions[b] - mesh.positions[a],
                                     mesh.positions[c] - mesh.positions[a]))};
  return sum;
}

Mesh cut_to(const Dag& dag, uint64_t triangles) {
  const float error = error_for_triangles(dag.tables, triangles);
  return mesh_of_cut(dag.tables, testing::reader_of(dag), select(dag.tables, view_error(error)));
}

Dag built(const Mesh& mesh, bool keep_area, uint32_t threads = 0) {
  Config config;
  config.keep_area = keep_area;
  BuildOptions options;
  options.threads = threads;
  return build(mesh.view(), config, options);
}

void expect_verified(const Mesh& mesh, const Dag& dag) {
  const VerifyReport report =
      verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh, 24));
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
}

uint64_t enlarged(const Dag& dag) {
  return dag.report.groups_by_limiting_factor[static_cast<size_t>(SimplifyMethod::kSloppy)]
                                             [static_cast<size_t>(LimitingFactor::kAreaLost)];
}

TEST(KeepArea, leaves_cover_what_they_did) {
  const Mesh mesh = scattered(shapes::grid(3, 3), 1200, 0.1f);
  const Dag with = built(mesh, true), without = built(mesh, false);
  expect_verified(mesh, with);
  EXPECT_GT(enlarged(with), 0u);
  EXPECT_EQ(enlarged(without), 0u);
  EXPECT_EQ(with.report.stuck_groups, 0u);
  for (const double share : {0.1, 0.03}) {
    const auto budget = static_cast<uint64_t>(share * static_cast<double>(mesh.triangles.size()));
    EXPECT_LT(area(cut_to(without, budget)), 0.85 * area(mesh)) << share;
    EXPECT_GT(area(cut_to(with, budget)), 0.8 * area(mesh)) << share;
    EXPECT_LT(area(cut_to(with, budget)), 1.1 * area(mesh)) << share;
  }
}

TEST(KeepArea, rubble_stays_closed) {
  const Mesh mesh = scattered(shapes::sphere(1), 600, 0.05f);
  const Dag dag = built(mesh, true);
  expect_verified(mesh, dag);
  EXPECT_GT(enlarged(dag), 0u);
}

TEST(KeepArea, surfaces_of_one_piece_are_left_alone) {
  for (const Mesh& mesh : {shapes::blob(4, 2), shapes::terrain(60, 60, 3)}) {
    const Dag with = built(mesh, true), without = built(mesh, false);
    EXPECT_EQ(with.tables.groups, without.tables.groups);
    EXPECT_EQ(with.vertices.positions, without.vertices.positions);
  }
}

TEST(KeepArea, same_bytes_for_any_thread_count) {
  Mesh mesh = scattered(shapes::grid(2, 2), 2000, 0.05f);
  for (const Vec3& p : mesh.positions) mesh.uvs.push_back({p.x, p.y});
  for (const Vec3& p : mesh.positions) mesh.colors.push_back({p.x * p.x, p.y * p.y, 0, 1});
  const Dag one = built(mesh, true, 1), many = built(mesh, true, 4);
  expect_verified(mesh, one);
  EXPECT_EQ(one.tables.groups, many.tables.groups);
  EXPECT_EQ(one.vertices.positions, many.vertices.positions);
  EXPECT_EQ(one.cluster_vertices, many.cluster_vertices);
}

TEST(KeepArea, enlarged_parts_stay_on_the_grid_of_positions) {
  const Mesh mesh = scattered(shapes::grid(3, 3), 800, 0.1f);
  Config config;
  config.position_step = 0x1p-10f;
  const Dag dag = build(mesh.view(), config);
  EXPECT_GT(enlarged(dag), 0u);
  Mesh snapped = mesh;
  snap_to_grid(snapped.positions, config.position_step);
  expect_verified(snapped, dag);
  for (const Vec3& p : dag.vertices.positions)
    for (float c : {p.x, p.y, p.z})
      ASSERT_EQ(c / config.position_step, std::nearbyint(c / config.position_step));
}

}  // namespace
}  // namespace umbel::lod
