// Selection over the DAG of another builder, meshoptimizer's clusterlod.h, whose tables have no
// nodes.
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "lod/synthetic_dag.hpp"

#ifdef UMBEL_HAS_CLUSTERLOD
#include "meshoptimizer.h"
#ifndef __clang_analyzer__  // it is not ours to analyse
#define CLUSTERLOD_IMPLEMENTATION
#endif
#include "clusterlod.h"
#endif

namespace umbel::lod {
namespace {

#ifdef UMBEL_HAS_CLUSTERLOD

int append(Tables& tables, const clodGroup& group, const clodCluster* clusters, size_t count) {
  const auto g = static_cast<uint32_t>(tables.groups.size());
  const bool is_root = group.simplified.error == std::numeric_limits<float>::max();
  Group entry{};
  entry.clusters = {static_cast<uint32_t>(tables.clusters.size()), static_cast<uint32_t>(count)};
  entry.level = static_cast<uint32_t>(group.depth);
  entry.method = is_root ? SimplifyMethod::kRoot : SimplifyMethod::kRegular;
  const float* center = group.simplified.center;
  entry.sphere = {{center[0], center[1], center[2]}, group.simplified.radius};
  entry.error = is_root ? std::numeric_limits<float>::infinity() : group.simplified.error;
  tables.groups.push_back(entry);
  for (size_t i = 0; i < count; ++i) {
    Cluster cluster{};
    cluster.group = g;
    cluster.generating_group =
        clusters[i].refined < 0 ? kNone : static_cast<uint32_t>(clusters[i].refined);
    cluster.triangle_count = static_cast<uint32_t>(clusters[i].index_count / 3);
    cluster.vertex_count = static_cast<uint32_t>(clusters[i].vertex_count);
    tables.clusters.push_back(cluster);
  }
  return static_cast<int>(g);
}

Tables tables_of_clusterlod(const Mesh& mesh) {
  clodMesh given = {};
  given.indices = mesh.triangles[0].data();
  given.index_count = 3 * mesh.triangles.size();
  given.vertex_count = mesh.positions.size();
  given.vertex_positions = &mesh.positions[0].x;
  given.vertex_positions_stride = sizeof(Vec3);
  Tables tables;
  clodBuild(clodDefaultConfig(64), given,
            [&](clodGroup group, const clodCluster* clusters, size_t count) {
              return append(tables, group, clusters, count);
            });
  return tables;
}

TEST(HierarchyOfOthers, selects_what_testing_every_group_selects) {
  for (const Mesh& mesh : {shapes::blob(5, 2), shapes::terrain(80, 80, 4)}) {
    Tables tables = tables_of_clusterlod(mesh);
    ASSERT_TRUE(tables.nodes.empty());
    complete(tables);
    ASSERT_FALSE(tables.nodes.empty());
    EXPECT_GT(tables.levels.size(), 3u);
    EXPECT_NO_THROW(validate(tables));
    testing::Random random(3);
    for (int i = 0; i < 200; ++i) {
      const View view = i % 4 == 0 ? view_error(static_cast<float>(random.log_between(1e-5, 1)))
                                   : testing::random_camera(random, tables, {});
      const std::vector<uint32_t> cut = select(tables, view);
      EXPECT_EQ(select_hierarchy(tables, view), cut);
      EXPECT_EQ(select_breadth_first(tables, view), cut);
    }
    EXPECT_EQ(select_hierarchy(tables, view_level(0)), select(tables, view_level(0)));
  }
}

TEST(HierarchyOfOthers, budgets_hold) {
  Tables tables = tables_of_clusterlod(shapes::blob(5, 2));
  complete(tables);
  const std::vector<uint32_t> costs = triangle_costs(tables);
  for (const uint64_t budget : {500ull, 2000ull, 8000ull}) {
    const BudgetCuts made = select_for_budget(tables, view_error(0), costs, budget);
    EXPECT_LE(made.cost, budget);
    EXPECT_GT(made.cost, budget / 3);
  }
}

#endif

Tables without_nodes() {
  Tables tables = testing::random_tables(4, 40, {});
  tables.nodes.clear();
  tables.levels.clear();
  return tables;
}

TEST(Complete, gives_tables_the_levels_and_nodes_that_a_build_has) {
  const Tables whole = testing::random_tables(4, 40, {});
  Tables tables = without_nodes();
  complete(tables);
  EXPECT_EQ(tables.levels, whole.levels);
  EXPECT_EQ(tables.nodes, whole.nodes);
  complete(tables);
  EXPECT_EQ(tables.nodes, whole.nodes);
  Tables nothing;
  complete(nothing);
  EXPECT_TRUE(nothing.nodes.empty());
}

TEST(Complete, names_what_cannot_be) {
  const auto reject = [](const auto& spoil, const char* part) {
    Tables tables = without_nodes();
    spoil(tables);
    try {
      complete(tables);
      ADD_FAILURE() << part;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  reject([](Tables& t) { t.groups[1].level = 4000000000u; }, "group 1");
  reject([](Tables& t) { t.groups.back().level = 0; }, "levels");
  reject([](Tables& t) { t.groups[3].sphere.center.y = kNan; }, "group 3");
  reject([](Tables& t) { t.groups[5].sphere.radius = -1; }, "group 5");
  reject([](Tables& t) { t.groups[7].error = kNan; }, "group 7");
  reject([](Tables& t) { t.levels = {{0, 1u << 30}}; }, "level 0");
}

}  // namespace
}  // namespace umbel::lod
