#include <gtest/gtest.h>

#include "lod/topology.hpp"

namespace umbel::lod {
namespace {

std::vector<uint32_t> identity(size_t n) {
  std::vector<uint32_t> ids(n);
  for (size_t i = 0; i < n; ++i) ids[i] = static_cast<uint32_t>(i);
  return ids;
}

const std::vector<Triangle> kTetrahedron{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};

TEST(Topology, closed_surface_has_no_irregular_edge) {
  for (uint32_t c : irregular_components(kTetrahedron, identity(4))) EXPECT_EQ(c, kNone);
}

TEST(Topology, open_edges_are_one_component_a_border) {
  const std::vector<Triangle> two{{0, 1, 2}, {3, 4, 5}};
  const auto c = irregular_components(two, identity(6));
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
  for (uint32_t c : irregular_components(soup, ids)) EXPECT_EQ(c, kNone);
}

TEST(Topology, edge_of_three_triangles_and_edge_run_twice_the_same_way_are_irregular) {
  const std::vector<Triangle> book{{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  EXPECT_NE(irregular_components(book, identity(5))[0], kNone);
  std::vector<Triangle> flipped = kTetrahedron;
  std::swap(flipped[0][0], flipped[0][1]);
  EXPECT_NE(irregular_components(flipped, identity(4))[0], kNone);
}

bool never(uint32_t, uint32_t) { return false; }
bool always(uint32_t, uint32_t) { return true; }

// A square of two triangles around a centre: border 0 1 2 3 locked, centre 4.
class Square : public testing::Test {
 protected:
  std::vector<Triangle> piece{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  std::vector<uint8_t> locked{1, 1, 1, 1, 0};
  std::vector<uint32_t> component = std::vector<uint32_t>(5, kNone);
  PieceTopology topology;
  void SetUp() override { topology.set_piece(piece, locked, component); }
};

TEST_F(Square, itself_is_without_fault) { EXPECT_TRUE(topology.violations(piece, never).empty()); }

TEST_F(Square, new_edge_between_locked_vertices_is_a_chord_and_a_fault_where_none_is_allowed) {
  const std::vector<Triangle> result{{0, 1, 2}, {0, 2, 3}};
  EXPECT_TRUE(topology.violations(result, always).empty());
  ASSERT_EQ(topology.chords().size(), 1u);
  EXPECT_EQ(topology.chords()[0], (PositionPair{0, 2}));
  EXPECT_EQ(topology.fixed_edges().size(), 4u);
  const auto faults = topology.violations(result, never);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0], (std::pair<uint32_t, uint32_t>{0, 2}));
}

TEST_F(Square, lost_border_is_a_fault_unless_the_source_explains_it) {
  const std::vector<Triangle> result{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}};
  EXPECT_EQ(topology.violations(result, never).size(), 3u);
  component.assign(5, 7);
  topology.set_piece(piece, locked, component);
  EXPECT_TRUE(topology.violations(result, never).empty());
}

TEST_F(Square, four_triangles_on_one_edge_are_a_fault) {
  std::vector<Triangle> result = piece;
  result.insert(result.end(), {{0, 4, 1}, {0, 1, 4}});
  EXPECT_FALSE(topology.violations(result, never).empty());
}

}  // namespace
}  // namespace umbel::lod
