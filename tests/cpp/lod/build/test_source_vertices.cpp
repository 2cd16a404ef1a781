// What renderers and engines rely on: whose vertices clusters have, how full clusters are, where a
// build ends.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

// Two vertices each, equal or not, and some that no triangle uses.
Mesh with_copies(const Mesh& smooth) {
  Mesh mesh;
  mesh.positions = {{9, 9, 9}};
  for (const Triangle& t : smooth.triangles) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const uint32_t v : t) {
      const Vec3& p = smooth.positions[v];
      mesh.positions.push_back(p);
      mesh.normals.push_back(p);
      mesh.uvs.push_back({p.x > 0 ? p.y : p.y + 10, p.z});
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  mesh.normals.insert(mesh.normals.begin(), {0, 0, 1});
  mesh.uvs.insert(mesh.uvs.begin(), {0, 0});
  for (size_t i = 0; i < mesh.triangles.size(); ++i) mesh.materials.push_back(i % 7 == 0);
  return mesh;
}

TEST(SourceVertices, every_vertex_is_the_callers_or_new) {
  const Mesh mesh = with_copies(shapes::blob(4, 6));
  for (const bool refit : {false, true}) {
    Config config = testing::small_config();
    config.refit_attributes = refit;
    config.keep_area = false;
    const Dag dag = build(mesh.view(), config);
    ASSERT_EQ(dag.source_vertices.size(), dag.vertices.positions.size());
    size_t made = 0;
    for (const uint32_t v : dag.cluster_vertices) {
      const uint32_t source = dag.source_vertices[v];
      if (source == kNone) {
        ++made;
        continue;
      }
      ASSERT_LT(source, mesh.positions.size());
      EXPECT_EQ(mesh.positions[source], dag.vertices.positions[v]);
      EXPECT_EQ(mesh.normals[source], dag.vertices.normals[v]);
      EXPECT_EQ(mesh.uvs[source].x, dag.vertices.uvs[v].x);
    }
    EXPECT_EQ(made > 0, refit);
  }
}

TEST(SourceVertices, clusters_of_the_finest_level_are_the_mesh_in_the_callers_numbers) {
  const Mesh mesh = shapes::blob(3, 1);
  const Dag dag = build(mesh.view(), testing::small_config());
  std::vector<Triangle> found;
  for (const uint32_t c : select(dag.tables, view_level(0))) {
    const uint32_t* own = dag.cluster_vertices.data() + dag.vertex_offsets[c];
    for (uint32_t t = dag.triangle_offsets[c]; t < dag.triangle_offsets[c + 1]; ++t) {
      Triangle triangle;
      for (size_t k = 0; k < 3; ++k)
        triangle[k] = dag.source_vertices[own[dag.cluster_triangles[3 * t + k]]];
      std::ranges::rotate(triangle, std::ranges::min_element(triangle));
      found.push_back(triangle);
    }
  }
  std::vector<Triangle> given = mesh.triangles;
  for (Triangle& t : given) std::ranges::rotate(t, std::ranges::min_element(t));
  std::ranges::sort(found);
  std::ranges::sort(given);
  EXPECT_EQ(found, given);
}

TEST(BuildEnds, with_one_cluster_whatever_limit_binds) {
  for (const Mesh& mesh : {shapes::blob(5, 3), shapes::terrain(60, 60, 2), shapes::soup(900, 2)})
    for (const uint32_t vertices : {16u, 32u, 64u}) {
      Config config;
      config.max_vertices = vertices;
      const Dag dag = build(mesh.view(), config);
      ASSERT_EQ(dag.report.root_groups, 1u) << vertices;
      EXPECT_EQ(dag.report.stuck_groups, 0u) << vertices;
      EXPECT_EQ(dag.tables.groups.back().clusters.count, 1u) << vertices;
    }
}

TEST(BuildEnds, no_limit_is_as_much_as_bytes_can_name) {
  const Mesh mesh = shapes::blob(4, 3);
  Config none;
  none.max_triangles = none.max_vertices = 0;
  Config most;
  most.max_triangles = most.max_vertices = 256;
  EXPECT_EQ(build(mesh.view(), none).tables.clusters, build(mesh.view(), most).tables.clusters);
}

// Clusters share nothing: what they share would decide, and the penalties of groups be second.
TEST(ClusterSettings, reach_clusters_and_groups) {
  const Mesh mesh = shapes::soup(9000, 3);
  const auto with = [&](const std::function<void(Config&)>& change) {
    Config config;
    config.max_triangles = 64;
    config.max_vertices = 0;
    config.min_group = 4;
    config.max_group = 16;
    change(config);
    return build(mesh.view(), config);
  };
  const Dag usual = with([](Config&) {});
  const Dag exact = with([](Config& c) { c.min_triangles = c.max_triangles; });
  const auto finest = [](const Dag& dag) {
    return std::ranges::count(dag.tables.clusters, kNone, &Cluster::generating_group);
  };
  EXPECT_EQ(finest(exact), (9000 + 63) / 64);
  EXPECT_GT(finest(usual), finest(exact));
  for (const auto& change : std::initializer_list<std::function<void(Config&)>>{
           [](Config& c) { c.underfill_cost = 1; }, [](Config& c) { c.overlap_cost = 1; },
           [](Config& c) { c.group_underfill_cost = 0; },
           [](Config& c) { c.group_overlap_cost = 1; }}) {
    const Dag other = with(change);
    EXPECT_FALSE(other.tables.clusters == usual.tables.clusters);
    EXPECT_TRUE(
        verify(other.tables, testing::reader_of(other), testing::verify_config_of(other, mesh, 8))
            .ok);
  }
  EXPECT_THROW(with([](Config& c) { c.min_triangles = 129; }), Error);
  EXPECT_THROW(with([](Config& c) { c.underfill_cost = -0.1f; }), Error);
  EXPECT_THROW(with([](Config& c) { c.group_overlap_cost = 1.5f; }), Error);
}

}  // namespace
}  // namespace umbel::lod
