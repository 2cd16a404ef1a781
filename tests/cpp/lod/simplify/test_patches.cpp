#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "lod/simplify/patches.hpp"
#include "umbel/mesh.hpp"

namespace umbel::lod {
namespace {

struct Piece {
  Mesh mesh;
  std::vector<uint32_t> position_of, component;
  std::vector<uint8_t> locked;

  void add(const Mesh& part, float scale) {
    const uint32_t first = static_cast<uint32_t>(mesh.positions.size());
    for (const Vec3& p : part.positions)
      mesh.positions.push_back({p.x * scale, p.y * scale, p.z * scale});
    for (const Triangle& t : part.triangles)
      mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    position_of.resize(mesh.positions.size());
    std::iota(position_of.begin(), position_of.end(), 0u);
    component.resize(mesh.positions.size(), kNone);
    locked.resize(mesh.positions.size(), 0);
  }
  SheetInput input() const { return {position_of, mesh.positions, locked, component, {}}; }
};

TEST(Sheets, the_smallest_go_first_and_the_error_is_their_size) {
  Piece piece;
  for (float scale : {1.0f, 0.5f, 4.0f}) piece.add(shapes::sphere(1), scale);
  std::vector<Triangle> triangles = piece.mesh.triangles;
  const size_t each = triangles.size() / 3;
  EXPECT_NEAR(drop_sheets(piece.input(), each, triangles), 2.0 * std::sqrt(3.0), 0.1);
  ASSERT_EQ(triangles.size(), each);
  for (const Triangle& t : triangles) EXPECT_GE(t[0], 2 * piece.mesh.positions.size() / 3);
}

TEST(Sheets, those_with_a_locked_position_stay) {
  Piece piece;
  for (float scale : {1.0f, 0.5f, 4.0f}) piece.add(shapes::sphere(1), scale);
  piece.locked[0] = piece.locked.back() = 1;
  std::vector<Triangle> triangles = piece.mesh.triangles;
  const size_t each = triangles.size() / 3;
  drop_sheets(piece.input(), 0, triangles);
  EXPECT_EQ(triangles.size(), 2 * each);
}

TEST(Sheets, parts_that_only_irregular_edges_join_are_apart) {
  // Three squares like the pages of a book: the spine has three triangles and explains itself.
  Piece piece;
  piece.mesh.positions = {{0, 0, 0}, {0, 0, 1}};
  for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{0, 2, 0}, Vec3{-3, 0, 0}}) {
    const uint32_t v = static_cast<uint32_t>(piece.mesh.positions.size());
    piece.mesh.positions.insert(piece.mesh.positions.end(), {d, {d.x, d.y, d.z + 1}});
    piece.mesh.triangles.insert(piece.mesh.triangles.end(), {{0, v, v + 1}, {0, v + 1, 1}});
  }
  piece.add({}, 1.0f);
  std::fill(piece.component.begin(), piece.component.end(), 0u);
  // The diagonal of a page is regular, but all its ends are irregular positions.
  std::vector<Triangle> triangles = piece.mesh.triangles;
  drop_sheets(piece.input(), 3, triangles);
  EXPECT_LE(triangles.size(), 3u);
  EXPECT_FALSE(triangles.empty());
}

TEST(Sheets, the_last_becomes_a_double_sided_triangle) {
  Piece piece;
  piece.add(shapes::torus(16, 8), 1.0f);
  std::vector<Triangle> triangles = piece.mesh.triangles;
  EXPECT_GT(drop_sheets(piece.input(), 10, triangles), 2.0f);
  ASSERT_EQ(triangles.size(), 2u);
  EXPECT_EQ(triangles[0], (Triangle{triangles[1][2], triangles[1][1], triangles[1][0]}));
}

TEST(Sheets, caps_keep_the_border_and_nothing_else) {
  // A tube: its two rims are locked.
  Piece piece;
  const uint32_t sides = 12, rings = 9;
  for (uint32_t r = 0; r < rings; ++r)
    for (uint32_t s = 0; s < sides; ++s) {
      const float angle = 6.2831853f * static_cast<float>(s) / sides;
      piece.mesh.positions.push_back({std::cos(angle), std::sin(angle), static_cast<float>(r)});
    }
  for (uint32_t r = 0; r + 1 < rings; ++r)
    for (uint32_t s = 0; s < sides; ++s) {
      const uint32_t a = r * sides + s, b = r * sides + (s + 1) % sides;
      piece.mesh.triangles.insert(piece.mesh.triangles.end(),
                                  {{a, b, a + sides}, {b, b + sides, a + sides}});
    }
  piece.add({}, 1.0f);
  for (uint32_t v = 0; v < piece.locked.size(); ++v)
    piece.locked[v] = v < sides || v >= (rings - 1) * sides;
  std::vector<Triangle> triangles = piece.mesh.triangles;
  EXPECT_GT(cap_sheets(piece.input(), 30, triangles), 8.0f);
  EXPECT_EQ(triangles.size(), 2 * sides);
  // Every directed side that nothing cancels was one of the tube's.
  const auto borders = [](std::span<const Triangle> of) {
    std::map<std::pair<uint32_t, uint32_t>, int> sum;
    for (const Triangle& t : of)
      for (int i = 0; i < 3; ++i) {
        const uint32_t a = t[i], b = t[(i + 1) % 3];
        sum[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
      }
    std::erase_if(sum, [](const auto& side) { return side.second == 0; });
    return sum;
  };
  EXPECT_EQ(borders(triangles), borders(piece.mesh.triangles));
}

}  // namespace
}  // namespace umbel::lod
