#include <gtest/gtest.h>

#include <set>

#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

/// Two clusters of a triangle each that share the edge from (0,0,0) to (1,0,0).
struct TwoClusters {
  Tables tables;
  ClusterGeometry geometry[2];

  TwoClusters() {
    Cluster cluster{};
    cluster.triangle_count = 1;
    cluster.vertex_count = 3;
    cluster.generating_group = kNone;
    tables.clusters = {cluster, cluster};
    geometry[0].positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    geometry[1].positions = {{1, 0, 0}, {0, 0, 0}, {0, -1, 0}};
    geometry[0].triangles = geometry[1].triangles = {0, 1, 2};
  }

  Mesh mesh(const std::vector<uint32_t>& cut) const {
    return mesh_of_cut(tables, [this](uint32_t c) { return geometry[c]; }, cut);
  }
};

TEST(CutMesh, equal_vertices_become_one) {
  const Mesh mesh = TwoClusters().mesh({0, 1});
  EXPECT_EQ(mesh.positions.size(), 4u);
  const std::vector<Triangle> expected{{0, 1, 2}, {1, 0, 3}};
  EXPECT_EQ(mesh.triangles, expected);
  EXPECT_TRUE(mesh.materials.empty());
}

TEST(CutMesh, vertices_that_differ_in_any_stream_stay_apart) {
  TwoClusters two;
  for (ClusterGeometry& g : two.geometry) {
    g.normals.assign(3, {0, 0, 1});
    g.tangents.assign(3, {1, 0, 0, 1});
    g.uvs.assign(3, {0.5f, 0.5f});
    g.colors.assign(3, {1, 1, 1, 1});
  }
  EXPECT_EQ(two.mesh({0, 1}).positions.size(), 4u);
  TwoClusters other = two;
  other.geometry[1].normals[0] = {0, 1, 0};
  EXPECT_EQ(other.mesh({0, 1}).positions.size(), 5u);
  other = two;
  other.geometry[1].tangents[0].w = -1;
  EXPECT_EQ(other.mesh({0, 1}).positions.size(), 5u);
  other = two;
  other.geometry[1].uvs[0].y = 0;
  EXPECT_EQ(other.mesh({0, 1}).positions.size(), 5u);
  other = two;
  other.geometry[1].colors[0].w = 0;
  const Mesh mesh = other.mesh({0, 1});
  EXPECT_EQ(mesh.positions.size(), 5u);
  EXPECT_EQ(mesh.normals.size(), 5u);
  EXPECT_EQ(mesh.tangents.size(), 5u);
  EXPECT_EQ(mesh.uvs.size(), 5u);
  EXPECT_EQ(mesh.colors.size(), 5u);
}

TEST(CutMesh, materials_are_those_of_the_clusters) {
  TwoClusters two;
  two.tables.clusters[1].material = 7;
  const std::vector<uint32_t> both{0, 7}, reversed{7, 0};
  EXPECT_EQ(two.mesh({0, 1}).materials, both);
  EXPECT_EQ(two.mesh({1, 0}).materials, reversed);
  EXPECT_TRUE(two.mesh({0}).materials.empty());
}

TEST(CutMesh, an_empty_cut_is_an_empty_mesh) {
  const Mesh mesh = TwoClusters().mesh({});
  EXPECT_TRUE(mesh.positions.empty());
  EXPECT_TRUE(mesh.triangles.empty());
}

TEST(CutMesh, broken_clusters_are_rejected) {
  TwoClusters two;
  EXPECT_THROW(two.mesh({2}), Error);
  two.geometry[0].triangles[2] = 3;
  EXPECT_THROW(two.mesh({0}), Error);
  two.geometry[0].triangles = {0, 1};
  EXPECT_THROW(two.mesh({0}), Error);
  two.geometry[1].uvs.resize(2);
  EXPECT_THROW(two.mesh({1}), Error);
}

TEST(CutMesh, a_stream_that_some_clusters_lack_is_zero_there) {
  TwoClusters two;
  two.geometry[0].uvs.assign(3, {1, 1});
  const Mesh mesh = two.mesh({0, 1});
  ASSERT_EQ(mesh.uvs.size(), mesh.positions.size());
  EXPECT_EQ(mesh.uvs[0], (Vec2{1, 1}));
  EXPECT_EQ(mesh.uvs.back(), (Vec2{0, 0}));
}

TEST(CutMesh, level_zero_has_the_vertices_and_attributes_of_the_welded_source) {
  Mesh mesh = shapes::torus(60, 30);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    mesh.uvs.push_back({static_cast<float>(i), 0.5f});
    mesh.normals.push_back({0, 0, 1});
  }
  for (size_t t = 0; t < mesh.triangles.size(); ++t) mesh.materials.push_back(t < 1000 ? 1 : 2);
  const Mesh welded = weld(mesh.view());
  const Dag dag = build(mesh.view(), testing::small_config());
  const Mesh cut =
      mesh_of_cut(dag.tables, testing::reader_of(dag), select(dag.tables, view_level(0)));
  // A triangle as what it looks like, whatever its vertices' numbers.
  const auto looks = [](const Mesh& m) {
    std::multiset<std::array<float, 13>> all;
    for (size_t t = 0; t < m.triangles.size(); ++t) {
      std::array<uint32_t, 3> corners = m.triangles[t];
      std::rotate(corners.begin(),
                  std::min_element(corners.begin(), corners.end(),
                                   [&](uint32_t a, uint32_t b) { return m.uvs[a].x < m.uvs[b].x; }),
                  corners.end());
      std::array<float, 13> look{};
      for (int k = 0; k < 3; ++k) {
        const Vec3& p = m.positions[corners[k]];
        look[4 * k] = p.x, look[4 * k + 1] = p.y, look[4 * k + 2] = p.z;
        look[4 * k + 3] = m.uvs[corners[k]].x;
      }
      look[12] = static_cast<float>(m.materials[t]);
      all.insert(look);
    }
    return all;
  };
  EXPECT_EQ(looks(cut), looks(welded));
}

TEST(CutMesh, geometry_of_a_cluster_out_of_range_is_rejected) {
  const Dag dag = build(shapes::sphere(2).view());
  EXPECT_THROW(dag.geometry(static_cast<uint32_t>(dag.tables.clusters.size())), Error);
}

}  // namespace
}  // namespace umbel::lod
