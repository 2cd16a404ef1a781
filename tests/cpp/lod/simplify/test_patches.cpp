#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "lod/simplify/patches.hpp"
#include "umbel/mesh.hpp"

namespace umbel::lod {
namespace {

struct SubMesh {
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
  PatchInput input() const { return {position_of, mesh.positions, locked, component, {}}; }
};

TEST(Patches, the_smallest_go_first_and_the_error_is_their_size) {
  SubMesh sub_mesh;
  for (float scale : {1.0f, 0.5f, 4.0f}) sub_mesh.add(shapes::sphere(1), scale);
  std::vector<Triangle> triangles = sub_mesh.mesh.triangles;
  const size_t each = triangles.size() / 3;
  EXPECT_NEAR(remove_patches(sub_mesh.input(), each, triangles), 2.0 * std::sqrt(3.0), 0.1);
  ASSERT_EQ(triangles.size(), each);
  for (const Triangle& t : triangles) EXPECT_GE(t[0], 2 * sub_mesh.mesh.positions.size() / 3);
}

TEST(Patches, those_with_a_locked_position_stay) {
  SubMesh sub_mesh;
  for (float scale : {1.0f, 0.5f, 4.0f}) sub_mesh.add(shapes::sphere(1), scale);
  sub_mesh.locked[0] = sub_mesh.locked.back() = 1;
  std::vector<Triangle> triangles = sub_mesh.mesh.triangles;
  const size_t each = triangles.size() / 3;
  remove_patches(sub_mesh.input(), 0, triangles);
  EXPECT_EQ(triangles.size(), 2 * each);
}

TEST(Patches, parts_that_only_non_manifold_edges_join_are_apart) {
  // Three squares like the pages of a book: the spine has three triangles and allows itself.
  SubMesh sub_mesh;
  sub_mesh.mesh.positions = {{0, 0, 0}, {0, 0, 1}};
  for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{0, 2, 0}, Vec3{-3, 0, 0}}) {
    const uint32_t v = static_cast<uint32_t>(sub_mesh.mesh.positions.size());
    sub_mesh.mesh.positions.insert(sub_mesh.mesh.positions.end(), {d, {d.x, d.y, d.z + 1}});
    sub_mesh.mesh.triangles.insert(sub_mesh.mesh.triangles.end(), {{0, v, v + 1}, {0, v + 1, 1}});
  }
  sub_mesh.add({}, 1.0f);
  std::fill(sub_mesh.component.begin(), sub_mesh.component.end(), 0u);
  // The diagonal of a page is regular, but all its ends are non-manifold positions.
  std::vector<Triangle> triangles = sub_mesh.mesh.triangles;
  remove_patches(sub_mesh.input(), 3, triangles);
  EXPECT_LE(triangles.size(), 3u);
  EXPECT_FALSE(triangles.empty());
}

TEST(Patches, the_last_becomes_a_double_sided_triangle) {
  SubMesh sub_mesh;
  sub_mesh.add(shapes::torus(16, 8), 1.0f);
  std::vector<Triangle> triangles = sub_mesh.mesh.triangles;
  EXPECT_GT(remove_patches(sub_mesh.input(), 10, triangles), 2.0f);
  ASSERT_EQ(triangles.size(), 2u);
  EXPECT_EQ(triangles[0], (Triangle{triangles[1][2], triangles[1][1], triangles[1][0]}));
}

TEST(Patches, caps_keep_the_border_and_nothing_else) {
  // A tube: its two rims are locked.
  SubMesh sub_mesh;
  const uint32_t sides = 12, rings = 9;
  for (uint32_t r = 0; r < rings; ++r)
    for (uint32_t s = 0; s < sides; ++s) {
      const float angle = 6.2831853f * static_cast<float>(s) / sides;
      sub_mesh.mesh.positions.push_back({std::cos(angle), std::sin(angle), static_cast<float>(r)});
    }
  for (uint32_t r = 0; r + 1 < rings; ++r)
    for (uint32_t s = 0; s < sides; ++s) {
      const uint32_t a = r * sides + s, b = r * sides + (s + 1) % sides;
      sub_mesh.mesh.triangles.insert(sub_mesh.mesh.triangles.end(),
                                     {{a, b, a + sides}, {b, b + sides, a + sides}});
    }
  sub_mesh.add({}, 1.0f);
  for (uint32_t v = 0; v < sub_mesh.locked.size(); ++v)
    sub_mesh.locked[v] = v < sides || v >= (rings - 1) * sides;
  std::vector<Triangle> triangles = sub_mesh.mesh.triangles;
  EXPECT_GT(cap_patches(sub_mesh.input(), 30, triangles), 8.0f);
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
  EXPECT_EQ(borders(triangles), borders(sub_mesh.mesh.triangles));
}

}  // namespace
}  // namespace umbel::lod
