// What the caller locks stays in every cut, so that parts that are built apart join.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "base/math.hpp"
#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

using Point = std::tuple<float, float, float>;
using Edge = std::pair<Point, Point>;

Point point(const Vec3& p) { return {p.x, p.y, p.z}; }

// How many triangles each edge has, by positions.
std::map<Edge, int> edges_of(const Mesh& mesh) {
  std::map<Edge, int> edges;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const Point a = point(mesh.positions[t[k]]), b = point(mesh.positions[t[(k + 1) % 3]]);
      ++edges[{std::min(a, b), std::max(a, b)}];
    }
  return edges;
}

std::set<Edge> open_edges(const Mesh& mesh) {
  std::set<Edge> open;
  for (const auto& [edge, triangles] : edges_of(mesh))
    if (triangles == 1) open.insert(edge);
  return open;
}

Mesh cut_of(const Dag& dag, std::span<const uint32_t> cut) {
  return mesh_of_cut(dag.tables, testing::reader_of(dag), cut);
}

// The part of a terrain with x in [from, to), as a tile of its own.
Mesh tile(const Mesh& whole, float from, float to) {
  Mesh part = whole;
  std::erase_if(part.triangles, [&](const Triangle& t) {
    const float x =
        (whole.positions[t[0]].x + whole.positions[t[1]].x + whole.positions[t[2]].x) / 3;
    return x < from || x >= to;
  });
  return part;
}

std::vector<View> views_of(const Dag& dag) {
  std::vector<View> views = {view_error(0), view_error(1e30f)};
  for (size_t g = 0; g < dag.tables.groups.size(); g += 7)
    if (std::isfinite(dag.tables.groups[g].error))
      views.push_back(view_error(dag.tables.groups[g].error));
  return views;
}

TEST(HeldPositions, tiles_that_are_built_apart_join_in_every_pair_of_cuts) {
  const Mesh whole = shapes::terrain(64, 48, 3);
  const float middle = bounds(whole.view()).min.x * 0.5f + bounds(whole.view()).max.x * 0.5f;
  Config config = testing::small_config();
  config.lock_borders = true;
  const Mesh left = tile(whole, -1e30f, middle), right = tile(whole, middle, 1e30f);
  const Dag a = build(left.view(), config), b = build(right.view(), config);
  const std::set<Edge> outline = open_edges(whole);
  size_t least = left.triangles.size();
  for (const View& of_left : views_of(a))
    for (const View& of_right : {view_error(0), view_error(1e30f)}) {
      Mesh joined = cut_of(a, select(a.tables, of_left));
      least = std::min(least, joined.triangles.size());
      const Mesh other = cut_of(b, select(b.tables, of_right));
      const auto first = static_cast<uint32_t>(joined.positions.size());
      joined.positions.insert(joined.positions.end(), other.positions.begin(),
                              other.positions.end());
      for (const Triangle& t : other.triangles)
        joined.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
      EXPECT_EQ(open_edges(joined), outline);
    }
  EXPECT_LT(least, left.triangles.size() / 4);  // and still it is simplified
}

TEST(HeldPositions, without_locks_tiles_crack) {
  const Mesh whole = shapes::terrain(64, 48, 3);
  const Aabb box = bounds(whole.view());
  const Mesh part = tile(whole, -1e30f, 0.5f * (box.min.x + box.max.x));
  const Dag dag = build(part.view(), testing::small_config());
  EXPECT_NE(open_edges(cut_of(dag, select(dag.tables, view_error(1e30f)))), open_edges(part));
}

TEST(HeldPositions, borders_of_open_and_non_manifold_meshes_stay) {
  Mesh fins = shapes::grid(40, 40);  // with a strip that stands on its middle line
  const auto row = static_cast<uint32_t>(20 * 41);
  for (uint32_t x = 0; x < 41; ++x)
    fins.positions.push_back(fins.positions[row + x] + Vec3{0, 0, 0.1f});
  for (uint32_t x = 0; x < 40; ++x) {
    const uint32_t top = 41 * 41 + x;
    fins.triangles.push_back({row + x, row + x + 1, top});
    fins.triangles.push_back({row + x + 1, top + 1, top});
  }
  Config config = testing::small_config();
  config.lock_borders = true;
  for (const Mesh& mesh : {fins, shapes::moebius(200, 6), shapes::grid(50, 30)}) {
    const Dag dag = build(mesh.view(), config);
    const VerifyReport report =
        verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh));
    EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
    for (const View& view : views_of(dag))
      EXPECT_EQ(open_edges(cut_of(dag, select(dag.tables, view))), open_edges(mesh));
  }
}

// Locks every `step`th vertex.
void expect_locked_vertices_stay(const Mesh& mesh, size_t step) {
  std::vector<uint8_t> locked(mesh.positions.size(), 0);
  std::set<Point> kept;
  for (size_t v = 0; v < locked.size(); v += step) {
    locked[v] = 1;
    kept.insert(point(mesh.positions[v]));
  }
  const Dag dag = build(mesh.view(), testing::small_config(), {}, {}, locked);
  const VerifyReport report =
      verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh));
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
  for (const View& view : views_of(dag)) {
    std::set<Point> there;
    for (const Vec3& p : cut_of(dag, select(dag.tables, view)).positions) there.insert(point(p));
    EXPECT_TRUE(std::ranges::includes(there, kept));
  }
}

// Many copies of a mesh, each by itself.
Mesh rubble(const Mesh& one, int count) {
  Mesh all;
  for (int i = 0; i < count; ++i) {
    const auto first = static_cast<uint32_t>(all.positions.size());
    const Vec3 at{float(i * 37 % 100), float(i * 61 % 100), float(i * 17 % 100)};
    for (const Vec3& p : one.positions) all.positions.push_back(at + p);
    for (const Triangle& t : one.triangles)
      all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  return all;
}

TEST(HeldPositions, locked_vertices_stay_in_every_cut) {
  const Mesh mesh = shapes::blob(5, 2);
  expect_locked_vertices_stay(mesh, 250);
  std::vector<uint8_t> locked(mesh.positions.size(), 0);
  EXPECT_THROW(build(mesh.view(), {}, {}, {}, std::span(locked).first(3)), Error);
}

TEST(HeldPositions, components_stay_by_a_single_locked_vertex) {
  const Mesh ball = shapes::blob(1, 1), leaf = shapes::grid(1, 1);
  expect_locked_vertices_stay(rubble(ball, 200), 3 * ball.positions.size());
  expect_locked_vertices_stay(rubble(leaf, 1000), 10 * leaf.positions.size());
}

TEST(HeldPositions, threads_do_not_matter) {
  const Mesh mesh = shapes::terrain(60, 60, 5);
  Config config = testing::small_config();
  config.lock_borders = true;
  BuildOptions one, many;
  one.threads = 1, many.threads = 4;
  const Dag a = build(mesh.view(), config, one), b = build(mesh.view(), config, many);
  EXPECT_EQ(a.tables.groups, b.tables.groups);
  EXPECT_EQ(a.cluster_vertices, b.cluster_vertices);
}

}  // namespace
}  // namespace umbel::lod
