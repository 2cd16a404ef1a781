// What a limit on vertices costs, and what missing items and vertices cost beside it.
#include <gtest/gtest.h>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

size_t clusters_at(const Mesh& mesh, ClusterConfig config, float underfill,
                   float vertex_underfill) {
  config.underfill_cost = underfill;
  config.vertex_underfill_cost = vertex_underfill;
  return cluster_mesh(mesh.view(), config).ranges.size();
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
    EXPECT_GE(clusters_at(mesh, tight, 0.5f, 0), clusters_at(mesh, tight, 0.5f, 1));
    EXPECT_NE(clusters_at(mesh, tight, 0.5f, 0.5f), clusters_at(mesh, tight, 1, 0.5f));
    EXPECT_NE(clusters_at(mesh, tight, 0.5f, 0.5f), clusters_at(mesh, tight, 0.5f, 1));
    // Where vertices seldom run out, too.
    ClusterConfig half = cluster_preset("quality", 128), whole = half;
    half.max_vertices = whole.max_vertices = 128;
    half.underfill_cost = 0.5f;
    whole.underfill_cost = 1.0f;
    EXPECT_FALSE(same(cluster_mesh(mesh.view(), half), cluster_mesh(mesh.view(), whole)));
  }
}

}  // namespace
}  // namespace umbel
