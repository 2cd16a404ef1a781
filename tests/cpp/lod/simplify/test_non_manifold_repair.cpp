#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "lod/dag/topology.hpp"
#include "lod/simplify/non_manifold_repair.hpp"

namespace umbel::lod {
namespace {

// Local vertices and positions are the same here.
struct SubMesh {
  std::vector<Vec3> positions;
  std::vector<uint8_t> locked, spare;
  std::vector<uint64_t> patches;
  std::vector<uint32_t> position_of;
  std::vector<Triangle> triangles;

  SubMesh(std::vector<Vec3> p, std::vector<Triangle> t)
      : positions(std::move(p)),
        locked(positions.size(), 0),
        spare(positions.size(), 0),
        patches(positions.size(), 0),
        position_of(positions.size()),
        triangles(std::move(t)) {
    std::iota(position_of.begin(), position_of.end(), 0u);
  }

  float repair_edge(uint32_t a, uint32_t b) {
    const std::pair<uint32_t, uint32_t> fault{a, b};
    return repair_edges({position_of, positions, locked, patches, spare}, {&fault, 1}, triangles);
  }

  bool has_edge(uint32_t a, uint32_t b) const {
    return std::any_of(triangles.begin(), triangles.end(), [&](const Triangle& t) {
      return std::count(t.begin(), t.end(), a) && std::count(t.begin(), t.end(), b);
    });
  }
};

// A square 0 1 2 3 with the diagonal 0 2.
SubMesh square() {
  return SubMesh({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.45f, 0.5f, 0.01f}},
                 {{0, 1, 2}, {0, 2, 3}});
}

TEST(Repair, diagonal_is_flipped) {
  SubMesh sub_mesh = square();
  EXPECT_EQ(sub_mesh.repair_edge(0, 2), 0.0f);
  EXPECT_FALSE(sub_mesh.has_edge(0, 2));
  EXPECT_TRUE(sub_mesh.has_edge(1, 3));
  EXPECT_EQ(sub_mesh.triangles.size(), 2u);
}

TEST(Repair, flip_of_a_skew_quad_tells_how_far_it_moved_the_surface) {
  SubMesh sub_mesh = square();
  sub_mesh.positions[1].z = sub_mesh.positions[3].z = 0.2f;
  EXPECT_NEAR(sub_mesh.repair_edge(0, 2), 0.2f, 1e-6f);
}

TEST(Repair, flip_onto_two_locked_vertices_is_refused_and_the_edge_is_split_instead) {
  SubMesh sub_mesh = square();
  sub_mesh.locked = {1, 1, 1, 1, 0};
  sub_mesh.repair_edge(0, 2);
  EXPECT_TRUE(sub_mesh.has_edge(0, 2)) << "there is no spare vertex yet";
  sub_mesh.spare[4] = 1;
  EXPECT_NEAR(sub_mesh.repair_edge(0, 2), 0.01f, 1e-6f);
  EXPECT_FALSE(sub_mesh.has_edge(0, 2));
  EXPECT_FALSE(sub_mesh.has_edge(1, 3));
  EXPECT_EQ(sub_mesh.triangles.size(), 4u);
}

TEST(Repair, vertex_of_another_component_or_material_is_never_brought_in) {
  SubMesh sub_mesh = square();
  sub_mesh.locked = {1, 1, 1, 1, 0};
  sub_mesh.spare[4] = 1;
  sub_mesh.patches[4] = 1;
  sub_mesh.repair_edge(0, 2);
  EXPECT_EQ(sub_mesh.triangles.size(), 2u);
}

TEST(Repair, triangles_back_to_back_are_taken_out) {
  // Two patches at the edge 0 1, and a fin that both of its sides are there of.
  SubMesh sub_mesh({{0, 0, 0}, {1, 0, 0}, {0.5f, 1, 0}, {0.5f, -1, 0}, {0.5f, 0, 1}},
                   {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {1, 0, 4}});
  sub_mesh.repair_edge(0, 1);
  EXPECT_EQ(sub_mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {1, 0, 3}}));
}

TEST(Repair, seam_edge_is_not_flipped) {
  SubMesh sub_mesh = square();
  // The second triangle has vertices of its own at the ends of the diagonal.
  sub_mesh.positions.insert(sub_mesh.positions.end(),
                            {sub_mesh.positions[0], sub_mesh.positions[2]});
  sub_mesh.position_of = {0, 1, 2, 3, 4, 0, 2};
  sub_mesh.patches.assign(7, 0);
  sub_mesh.spare.assign(7, 0);
  sub_mesh.triangles = {{0, 1, 2}, {5, 6, 3}};
  sub_mesh.repair_edge(0, 2);
  EXPECT_EQ(sub_mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {5, 6, 3}}));
}

}  // namespace
}  // namespace umbel::lod
