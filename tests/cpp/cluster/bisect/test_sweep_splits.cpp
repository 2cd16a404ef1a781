// What a limit on vertices costs, and what missing items and vertices cost beside it.
#include <gtest/gtest.h>

#include <set>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

Clusters at_costs(const Mesh& mesh, ClusterConfig config, float underfill, float vertex_underfill) {
  config.underfill_cost = underfill;
  config.vertex_underfill_cost = vertex_underfill;
  return cluster_mesh(mesh.view(), config);
}

size_t clusters_at(const Mesh& mesh, const ClusterConfig& config, float underfill,
                   float vertex_underfill) {
  return at_costs(mesh, config, underfill, vertex_underfill).ranges.size();
}

TEST(SweepSplits, clusters_are_full_of_vertices_where_those_run_out_first) {
  const Mesh mesh = grid(200, 200, 10.0f);
  ClusterConfig config = cluster_preset("quality", 128);
  config.max_vertices = 64;
  const Items items = items_of(mesh);
  const ClusterMetrics m = cluster_metrics(items.input(), checked(items, config), 128);
  EXPECT_GE(m.mean_vertices, 0.88 * 64);
  ClusterConfig fast = cluster_preset("fast", 128);
  fast.max_vertices = 64;
  EXPECT_GE(cluster_metrics(items.input(), checked(items, fast), 128).mean_vertices, 0.82 * 64);
  // Triangles of their own vertices lose none to their neighbours: 21 fill a cluster.
  const Mesh loose = soup(20000, 3);
  EXPECT_LE(cluster_mesh(loose.view(), config).ranges.size(), 1.05 * 20000 / 21);
}

TEST(SweepSplits, each_underfill_cost_lowers_the_number_of_clusters) {
  const ClusterConfig tight = [] {
    ClusterConfig config = cluster_preset("quality", 128);
    config.max_vertices = 64;
    return config;
  }();
  for (const Mesh& mesh : {grid(300, 200, 10.0f), grid(250, 250, 40.0f)}) {
    EXPECT_GT(clusters_at(mesh, tight, 0, 0), clusters_at(mesh, tight, 1, 0));
    EXPECT_GT(clusters_at(mesh, tight, 0, 0), clusters_at(mesh, tight, 0, 1));
    EXPECT_GE(clusters_at(mesh, tight, 0, 0.5f), clusters_at(mesh, tight, 1, 0.5f));
    // Where they are as full as they can be, one cost has little left to do.
    EXPECT_GE(1.01 * clusters_at(mesh, tight, 0.5f, 0), clusters_at(mesh, tight, 0.5f, 1));
    const Clusters usual = at_costs(mesh, tight, 0.5f, 0.5f);
    EXPECT_FALSE(same(usual, at_costs(mesh, tight, 1, 0.5f)));
    EXPECT_FALSE(same(usual, at_costs(mesh, tight, 0.5f, 1)));
    // Where vertices seldom run out, too.
    ClusterConfig half = cluster_preset("quality", 128), whole = half;
    half.max_vertices = whole.max_vertices = 128;
    half.underfill_cost = 0.5f;
    whole.underfill_cost = 1.0f;
    EXPECT_FALSE(same(cluster_mesh(mesh.view(), half), cluster_mesh(mesh.view(), whole)));
  }
}

// Small tilted sheets at random places, through each other, so that planes cut some of them.
Mesh leaves(uint32_t count, uint32_t side) {
  const Mesh places = soup(count, 5, 0.0f), leaf = grid(side, side);
  Mesh mesh;
  for (const Triangle& place : places.triangles) {
    const uint32_t first = static_cast<uint32_t>(mesh.positions.size());
    for (const Vec3& p : leaf.positions)
      mesh.positions.push_back(places.positions[place[0]] +
                               Vec3{p.x, p.y, 0.3f * p.x} * (0.1f / float(side)));
    for (const Triangle& t : leaf.triangles)
      mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return mesh;
}

TEST(SweepSplits, small_components_stay_whole_as_far_as_missing_vertices_cost) {
  const Mesh mesh = leaves(600, 2);
  ClusterConfig config = cluster_preset("quality", 128);
  config.max_vertices = 128;
  const auto doubled = [&](float cost) {
    const Clusters clusters = at_costs(mesh, config, config.underfill_cost, cost);
    size_t vertices = 0;
    for (const Range& r : clusters.ranges) {
      std::set<uint32_t> own;
      for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
        for (uint32_t v : mesh.triangles[clusters.items[i]]) own.insert(v);
      vertices += own.size();
    }
    return vertices - mesh.positions.size();
  };
  EXPECT_LT(doubled(0.5f), doubled(0));
  EXPECT_LT(2 * doubled(1), doubled(0));
  EXPECT_LT(clusters_at(mesh, config, 0.3f, 1), clusters_at(mesh, config, 0.3f, 0));
}

}  // namespace
}  // namespace umbel
