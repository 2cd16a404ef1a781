#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "umbel/mesh.hpp"

namespace umbel {
namespace {

/// The same triangles with three vertices of their own each.
Mesh unwelded(const Mesh& mesh) {
  Mesh result;
  result.materials = mesh.materials;
  for (const Triangle& t : mesh.triangles) {
    const auto first = static_cast<uint32_t>(result.positions.size());
    for (uint32_t v : t) {
      result.positions.push_back(mesh.positions[v]);
      if (!mesh.normals.empty()) result.normals.push_back(mesh.normals[v]);
      if (!mesh.uvs.empty()) result.uvs.push_back(mesh.uvs[v]);
    }
    result.triangles.push_back({first, first + 1, first + 2});
  }
  return result;
}

void expect_same_corners(const Mesh& a, const Mesh& b) {
  ASSERT_EQ(a.triangles.size(), b.triangles.size());
  for (size_t i = 0; i < a.triangles.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const uint32_t u = a.triangles[i][c], v = b.triangles[i][c];
      EXPECT_EQ(a.positions[u], b.positions[v]);
      if (!a.normals.empty()) {
        EXPECT_EQ(a.normals[u], b.normals[v]);
      }
      if (!a.uvs.empty()) {
        EXPECT_EQ(a.uvs[u], b.uvs[v]);
      }
    }
}

TEST(Weld, undoes_unwelding) {
  const Mesh mesh = shapes::blob(4, 7);
  const Mesh welded = weld(unwelded(mesh).view());
  EXPECT_EQ(welded.positions.size(), mesh.positions.size());
  expect_same_corners(mesh, welded);
}

TEST(Weld, is_idempotent) {
  const Mesh once = weld(unwelded(shapes::terrain(20, 30, 1)).view());
  const Mesh twice = weld(once.view());
  EXPECT_EQ(once.triangles, twice.triangles);
  EXPECT_EQ(once.positions, twice.positions);
}

TEST(Weld, numbers_vertices_by_first_use) {
  const Mesh welded = weld(unwelded(shapes::blob(3, 7)).view());
  uint32_t next = 0;
  for (const Triangle& t : welded.triangles)
    for (uint32_t v : t) {
      ASSERT_LE(v, next);
      next = std::max(next, v + 1);
    }
  EXPECT_EQ(next, welded.positions.size());
}

TEST(Weld, keeps_vertices_apart_whose_attributes_differ) {
  Mesh mesh = shapes::grid(4, 4);
  for (uint32_t i = 0; i < 25; ++i) {
    mesh.normals.push_back({0, 0, 1});
    mesh.uvs.push_back({0, 0});
  }
  Mesh split = unwelded(mesh);
  for (size_t i = 0; i < split.uvs.size() / 2; ++i) split.uvs[i].x = 0.25f;
  const Mesh welded = weld(split.view());
  expect_same_corners(split, welded);
  std::set<std::pair<std::array<float, 3>, float>> distinct;
  for (size_t i = 0; i < split.positions.size(); ++i)
    distinct.insert({std::bit_cast<std::array<float, 3>>(split.positions[i]), split.uvs[i].x});
  EXPECT_EQ(welded.positions.size(), distinct.size());
  EXPECT_GT(welded.positions.size(), 25u);
}

TEST(Weld, never_gives_a_vertex_two_materials) {
  Mesh mesh = shapes::blob(3, 2);
  for (size_t i = 0; i < mesh.triangles.size(); ++i)
    mesh.materials.push_back(static_cast<uint32_t>(i * 7 % 5));
  const Mesh welded = weld(mesh.view());
  EXPECT_EQ(welded.materials, mesh.materials);
  expect_same_corners(mesh, welded);
  std::map<uint32_t, uint32_t> material_of;
  std::set<std::pair<uint32_t, uint32_t>> distinct;
  for (size_t i = 0; i < welded.triangles.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const auto [at, fresh] = material_of.insert({welded.triangles[i][c], welded.materials[i]});
      EXPECT_EQ(at->second, welded.materials[i]);
      distinct.insert({mesh.triangles[i][c], mesh.materials[i]});
    }
  EXPECT_EQ(welded.positions.size(), distinct.size());
}

TEST(Weld, counts_minus_zero_as_zero) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.0f, 0, -0.0f}, {0, -1, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 1}};
  const Mesh welded = weld(mesh.view());
  EXPECT_EQ(welded.positions.size(), 4u);
  EXPECT_EQ(welded.triangles[1][0], 0u);
  mesh.triangles = {{3, 4, 1}};
  for (const Vec3& p : weld(mesh.view()).positions)
    for (float f : std::bit_cast<std::array<float, 3>>(p)) EXPECT_FALSE(f == 0 && std::signbit(f));
}

TEST(Weld, drops_unused_vertices) {
  Mesh mesh = shapes::sphere(2);
  const size_t used = mesh.positions.size();
  mesh.positions.insert(mesh.positions.begin(), 5000, Vec3{1, 2, 3});
  for (Triangle& t : mesh.triangles)
    for (uint32_t& v : t) v += 5000;
  EXPECT_EQ(weld(mesh.view()).positions.size(), used);
}

TEST(Weld, keeps_degenerate_and_duplicate_triangles) {
  Mesh mesh;
  mesh.positions.assign(30, Vec3{1, 1, 1});
  for (uint32_t i = 0; i < 10; ++i) mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  const Mesh welded = weld(mesh.view());
  EXPECT_EQ(welded.positions.size(), 1u);
  EXPECT_EQ(welded.triangles, (std::vector<Triangle>(10, Triangle{0, 0, 0})));
}

TEST(Weld, gives_the_same_for_any_thread_count) {
  const Mesh mesh = unwelded(shapes::blob(6, 5));
  BuildOptions one, four;
  one.threads = 1, four.threads = 4;
  const Mesh a = weld(mesh.view(), one), b = weld(mesh.view(), four);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.positions, b.positions);
}

TEST(Weld, rejects_what_it_cannot_read) {
  Mesh mesh = shapes::grid(1, 1);
  mesh.triangles[1][0] = 4;
  EXPECT_THROW(weld(mesh.view()), Error);
  mesh = shapes::grid(1, 1);
  mesh.normals.resize(1);
  EXPECT_THROW(weld(mesh.view()), Error);
}

TEST(Weld, of_nothing_is_nothing) {
  Mesh mesh;
  EXPECT_TRUE(weld(mesh.view()).positions.empty());
  mesh.positions.resize(10);
  EXPECT_TRUE(weld(mesh.view()).positions.empty());
}

TEST(PositionIds, are_the_lowest_vertex_at_the_position) {
  const Mesh mesh = unwelded(shapes::blob(3, 9));
  std::vector<Vec3> positions = mesh.positions;
  positions.push_back({-0.0f, 0, 0});
  positions.push_back({0, -0.0f, 0});
  const std::vector<uint32_t> ids = position_ids(positions);
  std::map<std::array<float, 3>, uint32_t> first;
  for (uint32_t i = 0; i < positions.size(); ++i) {
    std::array<float, 3> key{positions[i].x + 0.0f, positions[i].y + 0.0f, positions[i].z + 0.0f};
    EXPECT_EQ(ids[i], first.insert({key, i}).first->second);
  }
  EXPECT_TRUE(position_ids({}).empty());
}

TEST(SnapToGrid, keeps_shared_vertices_shared_and_moves_no_further_than_it_says) {
  Mesh mesh = unwelded(shapes::blob(4, 1));
  const std::vector<Vec3> before = mesh.positions;
  const std::vector<uint32_t> ids = position_ids(before);
  const float step = 0x1p-8f;
  const float moved = snap_to_grid(mesh.positions, step);
  EXPECT_GT(moved, 0.0f);
  EXPECT_LE(moved, step * 0.8661f);  // half a cell's diagonal
  float farthest = 0;
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(mesh.positions[i], mesh.positions[ids[i]]);
    for (float f : std::bit_cast<std::array<float, 3>>(mesh.positions[i]))
      EXPECT_EQ(f / step, std::nearbyint(f / step));
    farthest = std::max(
        farthest, std::hypot(mesh.positions[i].x - before[i].x, mesh.positions[i].y - before[i].y,
                             mesh.positions[i].z - before[i].z));
  }
  EXPECT_FLOAT_EQ(moved, farthest);
  EXPECT_EQ(snap_to_grid(mesh.positions, step), 0.0f);
}

TEST(SnapToGrid, takes_only_powers_of_two) {
  std::vector<Vec3> positions(1);
  for (float step : {0.0f, -1.0f, 0.3f, std::numeric_limits<float>::infinity(),
                     std::numeric_limits<float>::quiet_NaN()})
    EXPECT_THROW(snap_to_grid(positions, step), Error);
  constexpr float kMost = std::numeric_limits<float>::max();
  positions = {{kMost, -kMost, 1e-40f}};
  snap_to_grid(positions, 0x1p127f);
  EXPECT_EQ(positions[0], (Vec3{0x1p127f, -0x1p127f, 0}));
}

}  // namespace
}  // namespace umbel
