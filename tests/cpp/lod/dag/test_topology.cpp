#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "lod/dag/cluster_topology.hpp"
#include "lod/dag/topology.hpp"

namespace umbel::lod {
namespace {

std::vector<uint32_t> identity(size_t n) {
  std::vector<uint32_t> ids(n);
  for (size_t i = 0; i < n; ++i) ids[i] = static_cast<uint32_t>(i);
  return ids;
}

const std::vector<Triangle> kTetrahedron{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};

TEST(Topology, closed_surface_has_no_irregular_edge) {
  for (uint32_t c : non_manifold_components(kTetrahedron, identity(4))) EXPECT_EQ(c, kNone);
}

TEST(Topology, open_edges_are_one_component_a_border) {
  const std::vector<Triangle> two{{0, 1, 2}, {3, 4, 5}};
  const auto c = non_manifold_components(two, identity(6));
  EXPECT_EQ(c[0], c[1]);
  EXPECT_EQ(c[0], c[2]);
  EXPECT_EQ(c[3], c[4]);
  EXPECT_NE(c[0], c[3]);
}

TEST(Topology, unwelded_vertices_at_one_position_close_the_surface) {
  std::vector<Triangle> soup;
  std::vector<uint32_t> ids;
  for (const Triangle& t : kTetrahedron) {
    const uint32_t base = static_cast<uint32_t>(ids.size());
    soup.push_back({base, base + 1, base + 2});
    ids.insert(ids.end(), t.begin(), t.end());
  }
  // Position ids name the first vertex of each position.
  std::vector<uint32_t> first(4, kNone);
  for (uint32_t i = 0; i < ids.size(); ++i)
    if (first[ids[i]] == kNone) first[ids[i]] = i;
  for (uint32_t& id : ids) id = first[id];
  for (uint32_t c : non_manifold_components(soup, ids)) EXPECT_EQ(c, kNone);
}

TEST(Topology, edge_of_three_triangles_and_edge_run_twice_the_same_way_are_non_manifold) {
  const std::vector<Triangle> book{{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  EXPECT_NE(non_manifold_components(book, identity(5))[0], kNone);
  std::vector<Triangle> flipped = kTetrahedron;
  std::swap(flipped[0][0], flipped[0][1]);
  EXPECT_NE(non_manifold_components(flipped, identity(4))[0], kNone);
}

// A torus of quads with vertices that share positions at random, holes, flipped and repeated
// triangles; in clusters of `size` triangles that take what comes next.
ClusterSet faulty_torus(std::mt19937& random, size_t size, std::vector<uint32_t>& ids,
                        std::vector<Triangle>& triangles) {
  constexpr uint32_t kSide = 12;
  const auto chance = [&](uint32_t one_in) { return random() % one_in == 0; };
  ids = identity(kSide * kSide);
  const auto corner = [&](uint32_t x, uint32_t y) {
    const uint32_t p = y % kSide * kSide + x % kSide;
    if (!chance(20)) return p;
    ids.push_back(chance(20) ? 0 : p);
    return static_cast<uint32_t>(ids.size() - 1);
  };
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x) {
      const auto a = corner(x, y), b = corner(x + 1, y), c = corner(x + 1, y + 1);
      triangles.insert(triangles.end(), {{a, b, c}, {a, c, corner(x, y + 1)}});
      if (chance(40)) triangles.pop_back();
      if (chance(40)) std::swap(triangles.back()[0], triangles.back()[1]);
      if (chance(40)) triangles.push_back(triangles.back());
    }
  ClusterSet set;
  for (size_t begin = 0; begin < triangles.size(); begin += size) {
    std::vector<uint32_t> vertices;
    std::vector<uint8_t> corners;
    for (size_t i = begin; i < std::min(begin + size, triangles.size()); ++i)
      for (uint32_t v : triangles[i]) {
        const auto at = std::find(vertices.begin(), vertices.end(), v);
        corners.push_back(static_cast<uint8_t>(at - vertices.begin()));
        if (at == vertices.end()) vertices.push_back(v);
      }
    set.append(vertices, corners, kNone, 0, {});
  }
  return set;
}

TEST(Topology, clusters_tell_what_all_triangles_do) {
  std::mt19937 random(5);
  for (size_t size : {1, 5, 20, 60, 80})
    for (int i = 0; i < 20; ++i) {
      std::vector<uint32_t> ids;
      std::vector<Triangle> triangles;
      const ClusterSet set = faulty_torus(random, size, ids, triangles);
      const ClusterTopology topology = cluster_topology(set, ids);
      EXPECT_EQ(topology.non_manifold_components, non_manifold_components(triangles, ids));
      const auto degenerate = std::ranges::count_if(triangles, [&](const Triangle& t) {
        return ids[t[0]] == ids[t[1]] || ids[t[1]] == ids[t[2]] || ids[t[2]] == ids[t[0]];
      });
      EXPECT_EQ(topology.degenerate_triangles, static_cast<size_t>(degenerate));
    }
}

bool never(uint32_t, uint32_t) { return false; }
bool always(uint32_t, uint32_t) { return true; }

// A square of two triangles around a centre: border 0 1 2 3 locked, centre 4.
class Square : public testing::Test {
 protected:
  std::vector<Triangle> sub_mesh{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  std::vector<uint8_t> locked{1, 1, 1, 1, 0};
  std::vector<uint32_t> component = std::vector<uint32_t>(5, kNone);
  SubMeshTopology topology;
  void SetUp() override { topology.set_sub_mesh(sub_mesh, locked, component); }
};

TEST_F(Square, itself_is_without_fault) {
  EXPECT_TRUE(topology.violations(sub_mesh, never).empty());
}

TEST_F(Square, new_edge_between_locked_vertices_is_a_chord_and_a_fault_where_none_is_allowed) {
  const std::vector<Triangle> result{{0, 1, 2}, {0, 2, 3}};
  EXPECT_TRUE(topology.violations(result, always).empty());
  ASSERT_EQ(topology.locked_edges().size(), 1u);
  EXPECT_EQ(topology.locked_edges()[0], (PositionPair{0, 2}));
  EXPECT_EQ(topology.own_locked_edges().size(), 4u);
  const auto faults = topology.violations(result, never);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0], (std::pair<uint32_t, uint32_t>{0, 2}));
}

TEST_F(Square, lost_border_is_a_fault_unless_the_source_allows_it) {
  const std::vector<Triangle> result{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}};
  EXPECT_EQ(topology.violations(result, never).size(), 3u);
  component.assign(5, 7);
  topology.set_sub_mesh(sub_mesh, locked, component);
  EXPECT_TRUE(topology.violations(result, never).empty());
}

TEST_F(Square, triangles_that_are_turned_over_are_a_fault_by_direction) {
  EXPECT_TRUE(topology.violations(sub_mesh, never, true).empty());
  const std::vector<Triangle> same{{0, 1, 2}, {0, 2, 3}}, one{{0, 1, 2}, {0, 3, 2}};
  EXPECT_TRUE(topology.violations(same, always, true).empty());
  EXPECT_TRUE(topology.violations(one, always).empty());
  EXPECT_EQ(topology.violations(one, always, true).size(), 3u);
  EXPECT_TRUE(topology.locked_edges().empty());
}

TEST_F(Square, four_triangles_on_one_edge_are_a_fault) {
  std::vector<Triangle> result = sub_mesh;
  result.insert(result.end(), {{0, 4, 1}, {0, 1, 4}});
  EXPECT_FALSE(topology.violations(result, never).empty());
}

}  // namespace
}  // namespace umbel::lod
