// Units that are built apart, through files, are one sound DAG whatever the order.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <ranges>
#include <string>
#include <vector>

#include "base/math.hpp"
#include "scale/join_parts.hpp"
#include "scale/run_task.hpp"
#include "scale/tiers.hpp"
#include "scale/units.hpp"
#include "umbel/lod.hpp"

namespace umbel::scale::testing {
namespace {

struct Built {
  lod::Dag dag;
  uint32_t tiers = 0;
  size_t first_units = 0;
};

Built build(const Mesh& mesh, uint64_t capacity, bool reversed = false, lod::Config config = {},
            uint32_t rounds = 0) {
  const umbel::testing::Scratch scratch;
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  Built built;
  const auto run = [&](std::span<const Task> tasks) {
    if (built.tiers++ == 0) built.first_units = tasks.size();
    std::vector<Task> order(tasks.begin(), tasks.end());
    if (reversed) std::reverse(order.begin(), order.end());
    for (const Task& task : order) run_task(scratch / ".", task);
  };
  ScaleConfig scale;
  scale.capacity = capacity;
  scale.rounds = rounds;
  built.dag = build_in_tiers(source, config, scale, scratch / ".", run);
  return built;
}

void expect_sound(const Mesh& mesh, const lod::Dag& dag) {
  lod::VerifyConfig config;
  config.source_triangles = mesh.triangles.size();
  config.source_digest = triangle_set_digest(mesh.view());
  const lod::VerifyReport report =
      lod::verify(dag.tables, [&](uint32_t c) { return dag.geometry(c); }, config);
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
}

bool same(const lod::Dag& a, const lod::Dag& b) {
  return a.tables.groups == b.tables.groups && a.tables.clusters == b.tables.clusters &&
         a.tables.nodes == b.tables.nodes && a.cluster_vertices == b.cluster_vertices &&
         a.cluster_triangles == b.cluster_triangles && a.vertices.positions == b.vertices.positions;
}

// All in one place: units share every position, and what is left of pairs is nothing.
Mesh identical(uint32_t triangles) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles.assign(triangles, Triangle{0, 1, 2});
  return mesh;
}

// Leaves of two triangles on a lattice, many of them twice: enlarged ones meet whatever they can.
Mesh leaves(uint32_t side) {
  Mesh mesh;
  for (uint32_t i = 0; i < 2 * side * side; ++i) {
    const uint32_t k = i % 3 == 0 ? i / 2 : i % (side * side);
    const uint32_t row = k / side, column = k % side;
    const auto x = static_cast<float>(column), y = static_cast<float>(row);
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const auto& [u, v] : {std::pair{0.0f, 0.0f}, {0.5f, 0.0f}, {0.0f, 0.5f}, {0.5f, 0.5f}})
      mesh.positions.push_back({x + u, y + v, static_cast<float>(i % 5) * 0.25f});
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first + 2, first + 1, first + 3});
  }
  return mesh;
}

std::vector<std::pair<std::string, Mesh>> meshes() {
  return {{"terrain", shapes::terrain(60, 60, 1)},
          {"blob", shapes::blob(4, 2)},
          {"moebius", shapes::moebius(400, 8)},
          {"fan", shapes::fan(5000)},
          {"soup", shapes::soup(4000, 3)},
          {"identical", identical(4000)},
          {"tetrahedra", shapes::tetrahedra(1000)},
          {"rich", rich(shapes::terrain(50, 50, 5))},
          {"leaves", leaves(30)}};
}

TEST(Tiers, EveryMeshIsSoundAndTheSameInAnyOrder) {
  for (const auto& [name, mesh] : meshes())
    for (const uint32_t rounds : {1u, 2u}) {
      SCOPED_TRACE(name + ", rounds: " + std::to_string(rounds));
      const Built built = build(mesh, 1000, false, {}, rounds);
      EXPECT_GT(built.first_units, 2u);
      EXPECT_GT(built.tiers, 1u);
      expect_sound(mesh, built.dag);
      EXPECT_TRUE(same(built.dag, build(mesh, 1000, true, {}, rounds).dag));
    }
}

double area(const lod::Dag& dag, uint64_t triangles) {
  const auto reader = [&](uint32_t c) { return dag.geometry(c); };
  const float error = lod::error_for_triangles(dag.tables, triangles);
  const Mesh mesh =
      lod::mesh_of_cut(dag.tables, reader, lod::select(dag.tables, lod::view_error(error)));
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += 0.5 * double{length(cross(mesh.positions[b] - mesh.positions[a],
                                     mesh.positions[c] - mesh.positions[a]))};
  return sum;
}

TEST(Tiers, LeavesKeepTheirArea) {
  const Mesh mesh = shapes::tetrahedra(4000);
  const double before = area(build(mesh, 1u << 20).dag, mesh.triangles.size());
  const double in_memory = area(build(mesh, 1u << 20).dag, 1000) / before;
  lod::Config without;
  without.keep_area = false;
  const double kept = area(build(mesh, 1000).dag, 1000) / before;
  EXPECT_GT(kept, 0.7 * in_memory);
  EXPECT_GT(kept, 1.5 * area(build(mesh, 1000, false, without).dag, 1000) / before);
}

// All tasks by others, in another order, each twice.
lod::Dag build_elsewhere(const Mesh& mesh, uint64_t capacity, std::vector<size_t>& counts) {
  const umbel::testing::Scratch scratch;
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  counts.assign(3, 0);
  TierOptions options;
  options.delegation.sorting = options.delegation.source = true;
  options.run = [&](std::span<const Task> tasks, const auto& poll) {
    for (const Task& task : tasks | std::views::reverse) {
      ++counts[static_cast<size_t>(task.kind)];
      for (int i = 0; i < 2; ++i) run_task(scratch / ".", task, {{}, {}, &source});
    }
    poll(tasks.size());
  };
  const lod::Config config;
  const BuiltTiers built = build_tiers(source, config, {capacity, 1}, scratch / ".", options);
  lod::Dag dag;
  dag.config = config;
  join_parts(built.parts, dag);
  return dag;
}

TEST(Tiers, SortingByTasksChangesNothing) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    std::vector<size_t> counts;
    const lod::Dag dag = build_elsewhere(mesh, 1000, counts);
    EXPECT_TRUE(same(build(mesh, 1000, false, {}, 1).dag, dag));
    EXPECT_GT(counts[static_cast<size_t>(TaskKind::kSort)], 2u);
  }
}

// Fails as a machine does that cannot read the source.
TEST(Tiers, ASourceThatOthersCannotReadIsSortedHere) {
  const umbel::testing::Scratch scratch;
  const Mesh mesh = shapes::terrain(60, 60, 1);
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  size_t refused = 0;
  TierOptions options;
  options.delegation.source = true;
  options.run = [&](std::span<const Task> tasks, const auto&) {
    for (const Task& task : tasks) {
      if (task.kind == TaskKind::kSort && ++refused) throw Error(ErrorCode::kIo, "no such file");
      run_task(scratch / ".", task);
    }
  };
  const BuiltTiers built = build_tiers(source, {}, {1000, 1}, scratch / ".", options);
  lod::Dag dag;
  join_parts(built.parts, dag);
  EXPECT_EQ(refused, 1u);
  EXPECT_TRUE(same(build(mesh, 1000, false, {}, 1).dag, dag));
}

TEST(Tiers, SmallUnitsMoveTheirBordersAfterEveryLevel) {
  EXPECT_EQ((ScaleConfig{.capacity = 65536}.rounds_of_tier()), 1u);
  EXPECT_EQ(ScaleConfig{}.rounds_of_tier(), 2u);
  const Mesh mesh = shapes::terrain(60, 60, 1);
  const Built built = build(mesh, 1000);
  EXPECT_TRUE(same(built.dag, build(mesh, 1000, false, {}, 1).dag));
  EXPECT_GT(built.tiers, build(mesh, 1000, false, {}, 2).tiers);
}

TEST(Tiers, OneUnitIsWhatBuildMakes) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    const Built built = build(mesh, 1u << 20);
    EXPECT_EQ(built.tiers, 1u);
    const lod::Dag whole = lod::build(mesh.view());
    EXPECT_EQ(built.dag.tables.groups, whole.tables.groups);
    EXPECT_EQ(built.dag.tables.clusters, whole.tables.clusters);
  }
}

TEST(Tiers, RefusesWhatNeedsTheWholeMesh) {
  lod::Config config;
  config.measured_error = true;
  EXPECT_THROW(build(shapes::blob(3, 1), 300, false, config), Error);
}

TEST(Tiers, AMeshWithoutTrianglesHasNoClusters) {
  const Built built = build(Mesh{}, 300);
  EXPECT_TRUE(built.dag.tables.clusters.empty());
  EXPECT_TRUE(built.dag.tables.groups.empty());
  expect_sound(Mesh{}, built.dag);
}

}  // namespace
}  // namespace umbel::scale::testing
