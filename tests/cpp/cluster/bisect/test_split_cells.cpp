// What nodes too large for a block are split by.
#include <gtest/gtest.h>

#include <random>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

// Long boxes in two layers: to part the layers takes more area, but to cut across them leaves two
// sides that overlap by more than half.
TEST(SplitCells, the_largest_nodes_are_split_where_boxes_overlap_least) {
  constexpr uint32_t kHalf = 10000;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1);
  Items items;
  for (uint32_t i = 0; i < 2 * kHalf; ++i) {
    const float x = 4 * unit(random), y = (i < kHalf ? 0.0f : 0.55f) + 0.4f * unit(random);
    items.boxes.push_back({{x, y, 0}, {x + 6, y + 0.05f, 4}});
  }
  const auto parts_layers = [&](float overlap_cost) {
    ClusterConfig config = limits(kHalf, kHalf);
    config.overlap_cost = overlap_cost;
    config.underfill_cost = 0;
    const Clusters halves = checked(items, config);
    EXPECT_EQ(halves.ranges.size(), 2u);
    const bool first = halves.items[0] < kHalf;
    for (uint32_t i = 0; i < kHalf; ++i)
      if ((halves.items[i] < kHalf) != first) return false;
    return true;
  };
  EXPECT_FALSE(parts_layers(0.0f));
  EXPECT_TRUE(parts_layers(0.5f));
}

}  // namespace
}  // namespace umbel
