#include <gtest/gtest.h>

#include "lod/dag/locked_edges.hpp"

namespace umbel::lod {
namespace {

std::vector<PositionPair> pairs(uint32_t count, uint32_t step) {
  std::vector<PositionPair> result;
  for (uint32_t i = 0; i < count; ++i) result.push_back({i * step, i * step + 1});
  return result;
}

TEST(LockedEdges, empty_set_has_no_edge) {
  EXPECT_FALSE(LockedEdgeSet().contains_any(pairs(10, 1)));
}

TEST(LockedEdges, edge_is_found_from_either_end_and_nothing_else_is) {
  LockedEdgeSet edges_of_all;
  edges_of_all.insert(pairs(50000, 3));
  edges_of_all.insert(pairs(50000, 3));
  for (uint32_t i = 0; i < 50000; ++i) {
    const PositionPair edge{3 * i, 3 * i + 1}, turned{3 * i + 1, 3 * i}, other{3 * i, 3 * i + 2};
    ASSERT_TRUE(edges_of_all.contains_any({&edge, 1}));
    ASSERT_TRUE(edges_of_all.contains_any({&turned, 1}));
    ASSERT_FALSE(edges_of_all.contains_any({&other, 1}));
  }
}

}  // namespace
}  // namespace umbel::lod
