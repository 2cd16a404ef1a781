#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "lod/dag/topology.hpp"
#include "lod/simplify/non_manifold_repair.hpp"

namespace umbel::lod {
namespace {

// Local vertices and positions are the same here.
struct Piece {
  std::vector<Vec3> positions;
  std::vector<uint8_t> locked, spare;
  std::vector<uint64_t> patches;
  std::vector<uint32_t> position_of;
  std::vector<Triangle> triangles;

  Piece(std::vector<Vec3> p, std::vector<Triangle> t)
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
    return repair({position_of, positions, locked, patches, spare}, {&fault, 1}, triangles);
  }

  bool has_edge(uint32_t a, uint32_t b) const {
    return std::any_of(triangles.begin(), triangles.end(), [&](const Triangle& t) {
      return std::count(t.begin(), t.end(), a) && std::count(t.begin(), t.end(), b);
    });
  }
};

// A square 0 1 2 3 with the diagonal 0 2.
Piece square() {
  return Piece({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.45f, 0.5f, 0.01f}},
               {{0, 1, 2}, {0, 2, 3}});
}

TEST(Repair, diagonal_is_flipped) {
  Piece piece = square();
  EXPECT_EQ(piece.repair_edge(0, 2), 0.0f);
  EXPECT_FALSE(piece.has_edge(0, 2));
  EXPECT_TRUE(piece.has_edge(1, 3));
  EXPECT_EQ(piece.triangles.size(), 2u);
}

TEST(Repair, flip_of_a_skew_quad_tells_how_far_it_moved_the_surface) {
  Piece piece = square();
  piece.positions[1].z = piece.positions[3].z = 0.2f;
  EXPECT_NEAR(piece.repair_edge(0, 2), 0.2f, 1e-6f);
}

TEST(Repair, flip_onto_two_locked_vertices_is_refused_and_the_edge_is_split_instead) {
  Piece piece = square();
  piece.locked = {1, 1, 1, 1, 0};
  piece.repair_edge(0, 2);
  EXPECT_TRUE(piece.has_edge(0, 2)) << "there is no spare vertex yet";
  piece.spare[4] = 1;
  EXPECT_NEAR(piece.repair_edge(0, 2), 0.01f, 1e-6f);
  EXPECT_FALSE(piece.has_edge(0, 2));
  EXPECT_FALSE(piece.has_edge(1, 3));
  EXPECT_EQ(piece.triangles.size(), 4u);
}

TEST(Repair, vertex_of_another_component_or_material_is_never_brought_in) {
  Piece piece = square();
  piece.locked = {1, 1, 1, 1, 0};
  piece.spare[4] = 1;
  piece.patches[4] = 1;
  piece.repair_edge(0, 2);
  EXPECT_EQ(piece.triangles.size(), 2u);
}

TEST(Repair, triangles_back_to_back_are_taken_out) {
  // Two sheets at the edge 0 1, and a fin that both of its sides are there of.
  Piece piece({{0, 0, 0}, {1, 0, 0}, {0.5f, 1, 0}, {0.5f, -1, 0}, {0.5f, 0, 1}},
              {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {1, 0, 4}});
  piece.repair_edge(0, 1);
  EXPECT_EQ(piece.triangles, (std::vector<Triangle>{{0, 1, 2}, {1, 0, 3}}));
}

TEST(Repair, seam_edge_is_not_flipped) {
  Piece piece = square();
  // The second triangle has vertices of its own at the ends of the diagonal.
  piece.positions.insert(piece.positions.end(), {piece.positions[0], piece.positions[2]});
  piece.position_of = {0, 1, 2, 3, 4, 0, 2};
  piece.patches.assign(7, 0);
  piece.spare.assign(7, 0);
  piece.triangles = {{0, 1, 2}, {5, 6, 3}};
  piece.repair_edge(0, 2);
  EXPECT_EQ(piece.triangles, (std::vector<Triangle>{{0, 1, 2}, {5, 6, 3}}));
}

}  // namespace
}  // namespace umbel::lod
