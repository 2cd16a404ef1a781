#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mesh/topology.hpp"
#include "umbel/mesh.hpp"

namespace umbel {
namespace {

using testing::border_edges;
using testing::is_closed_and_oriented;

double signed_volume(const Mesh& mesh) {
  double six_times = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    six_times += double{a.x} * (b.y * c.z - b.z * c.y) + double{a.y} * (b.z * c.x - b.x * c.z) +
                 double{a.z} * (b.x * c.y - b.y * c.x);
  }
  return six_times / 6;
}

void expect_valid_and_welded(const Mesh& mesh) {
  EXPECT_NO_THROW(validate(mesh.view()));
  EXPECT_EQ(weld(mesh.view()).positions.size(), mesh.positions.size());
}

TEST(Shapes, closed_ones_are_closed_oriented_and_inside_out_nowhere) {
  const std::pair<const char*, Mesh> closed[] = {{"sphere", shapes::sphere(4)},
                                                 {"torus", shapes::torus(24, 12)},
                                                 {"tetrahedra", shapes::tetrahedra(50)},
                                                 {"blob", shapes::blob(5, 11)}};
  for (const auto& [name, mesh] : closed) {
    SCOPED_TRACE(name);
    expect_valid_and_welded(mesh);
    EXPECT_TRUE(is_closed_and_oriented(mesh.view()));
    EXPECT_GT(signed_volume(mesh), 0);
  }
}

TEST(Shapes, have_the_counts_that_they_promise) {
  EXPECT_EQ(shapes::sphere(3).triangles.size(), 20u * 64);
  EXPECT_EQ(shapes::sphere(3).positions.size(), 10u * 64 + 2);
  EXPECT_EQ(shapes::grid(3, 5).triangles.size(), 30u);
  EXPECT_EQ(shapes::grid(3, 5).positions.size(), 24u);
  EXPECT_EQ(shapes::torus(10, 7).triangles.size(), 140u);
  EXPECT_EQ(shapes::fan(1000).triangles.size(), 1000u);
  EXPECT_EQ(shapes::soup(77, 1).triangles.size(), 77u);
  EXPECT_EQ(shapes::tetrahedra(10).triangles.size(), 40u);
  EXPECT_EQ(shapes::terrain(6, 4, 1).triangles.size(), 48u);
  EXPECT_EQ(shapes::grid(0, 5).triangles.size(), 0u);
  EXPECT_EQ(shapes::fan(0).triangles.size(), 0u);
}

TEST(Shapes, sphere_and_torus_lie_on_their_surfaces) {
  for (const Vec3& p : shapes::sphere(4).positions)
    EXPECT_NEAR(std::hypot(p.x, p.y, p.z), 1.0f, 2e-7f);
  for (const Vec3& p : shapes::torus(37, 23).positions)
    EXPECT_NEAR(std::hypot(std::hypot(p.x, p.y) - 1.0f, p.z), 0.35f, 1e-6f);
  const Mesh torus = shapes::torus(37, 23);
  for (uint32_t i = 0; i < 37; ++i)
    EXPECT_NEAR(torus.positions[i * 23].x, 1.35 * std::cos(2 * M_PI * i / 37), 1e-6);
}

TEST(Shapes, grid_and_terrain_have_one_border) {
  expect_valid_and_welded(shapes::grid(7, 5));
  EXPECT_EQ(border_edges(shapes::grid(7, 5).view()), 24u);
  const Mesh terrain = shapes::terrain(64, 32, 3);
  expect_valid_and_welded(terrain);
  EXPECT_EQ(border_edges(terrain.view()), 192u);
  const auto [low, high] =
      std::minmax_element(terrain.positions.begin(), terrain.positions.end(),
                          [](const Vec3& a, const Vec3& b) { return a.z < b.z; });
  EXPECT_GT(high->z - low->z, 0.02f);
  EXPECT_LT(high->z - low->z, 0.5f);
}

TEST(Shapes, moebius_strip_has_one_border_and_two_triangles_on_every_other_edge) {
  const Mesh mesh = shapes::moebius(40, 4);
  expect_valid_and_welded(mesh);
  EXPECT_EQ(border_edges(mesh.view()), 80u);
  EXPECT_FALSE(is_closed_and_oriented(mesh.view()));
  size_t against = 0;  // edges that both triangles run along in the same direction
  for (const auto& [edge, count] : testing::directed_edges(mesh.view())) against += count == 2;
  EXPECT_EQ(against, 4u);
  // One loop: walking along the border from one vertex meets all of it.
  std::map<uint32_t, std::vector<uint32_t>> next;
  const auto edges = testing::directed_edges(mesh.view());
  for (const auto& [edge, count] : edges)
    if (count == 1 && !edges.contains({edge.second, edge.first})) {
      next[edge.first].push_back(edge.second);
      next[edge.second].push_back(edge.first);
    }
  uint32_t previous = kNone, at = next.begin()->first;
  const uint32_t start = at;
  size_t steps = 0;
  do {
    ASSERT_EQ(next[at].size(), 2u);
    const uint32_t to = next[at][0] == previous ? next[at][1] : next[at][0];
    previous = at, at = to, ++steps;
  } while (at != start && steps < 200);
  EXPECT_EQ(steps, 80u);
}

TEST(Shapes, fan_has_one_vertex_of_that_valence) {
  const Mesh mesh = shapes::fan(5000);
  expect_valid_and_welded(mesh);
  std::vector<uint32_t> valence(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (uint32_t v : t) ++valence[v];
  EXPECT_EQ(valence[0], 5000u);
  EXPECT_EQ(*std::max_element(valence.begin() + 1, valence.end()), 2u);
  expect_valid_and_welded(shapes::fan(1));
  expect_valid_and_welded(shapes::fan(2));
}

TEST(Shapes, soup_is_unconnected) {
  const Mesh mesh = shapes::soup(2000, 5);
  expect_valid_and_welded(mesh);
  EXPECT_EQ(border_edges(mesh.view()), 6000u);
}

TEST(Shapes, blob_is_irregular_but_not_wild) {
  const Mesh mesh = shapes::blob(5, 4);
  float nearest = 10, farthest = 0;
  for (const Vec3& p : mesh.positions) {
    const float r = std::hypot(p.x, p.y, p.z);
    nearest = std::min(nearest, r), farthest = std::max(farthest, r);
  }
  EXPECT_GT(nearest, 0.5f);
  EXPECT_LT(farthest, 1.5f);
  EXPECT_GT(farthest - nearest, 0.2f);
}

TEST(Shapes, seeds_differ_and_runs_do_not) {
  EXPECT_EQ(shapes::blob(4, 1).positions, shapes::blob(4, 1).positions);
  EXPECT_NE(shapes::blob(4, 1).positions, shapes::blob(4, 2).positions);
  EXPECT_NE(shapes::soup(10, 1).positions, shapes::soup(10, 2).positions);
  EXPECT_NE(shapes::terrain(10, 10, 1).positions, shapes::terrain(10, 10, 2).positions);
}

TEST(Shapes, are_the_same_on_every_platform) {
  EXPECT_EQ(triangle_set_digest(shapes::blob(5, 1).view()), 9924015140162411596u);
  EXPECT_EQ(triangle_set_digest(shapes::terrain(50, 40, 1).view()), 10765717167752093734u);
  EXPECT_EQ(triangle_set_digest(shapes::torus(50, 40).view()), 6395393538181965492u);
}

TEST(Shapes, impossible_ones_are_refused) {
  EXPECT_THROW(shapes::sphere(13), Error);
  EXPECT_THROW(shapes::torus(2, 5), Error);
  EXPECT_THROW(shapes::moebius(2, 1), Error);
  EXPECT_THROW(shapes::moebius(5, 0), Error);
  EXPECT_THROW(shapes::grid(1u << 20, 1u << 20), Error);
  EXPECT_THROW(shapes::soup(kNone, 1), Error);
}

}  // namespace
}  // namespace umbel
