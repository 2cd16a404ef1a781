// What nodes too large for a block are split by, and that it is what others are split by too.
#include <gtest/gtest.h>

#include <random>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

// Long boxes in two layers: to part the layers takes more area, but to cut across them leaves two
// sides that overlap by more than half. Every box of the first layer has one of the second above
// it, to which it may be connected. There are `copies` of all that, far apart.
struct Layers {
  Items items;
  uint32_t half, copies;

  Layers(uint32_t half, uint32_t copies) : half(half), copies(copies) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> unit(0, 1);
    for (uint32_t copy = 0; copy < copies; ++copy) {
      std::vector<float> x(half);
      for (float& at : x) at = 100 * float(copy) + 4 * unit(random);
      for (const float layer : {0.0f, 0.55f})
        for (const float at : x) {
          const float y = layer + 0.4f * unit(random);
          items.boxes.push_back({{at, y, 0}, {at + 6, y + 0.05f, 4}});
        }
    }
  }
  void connect(float weight) {
    const uint32_t count = 2 * half * copies;
    items.ranges.clear();
    items.targets.clear();
    for (uint32_t i = 0; i < count; ++i) {
      items.ranges.push_back({i, 1});
      items.targets.push_back(i / half % 2 ? i - half : i + half);
    }
    items.weights.assign(count, weight);
  }
  // Whether each half of a copy is a layer.
  bool are_parted(float overlap_cost) const {
    ClusterConfig config = limits(half, half);
    config.overlap_cost = overlap_cost;
    config.underfill_cost = 0;
    const Clusters halves = checked(items, config);
    EXPECT_EQ(halves.ranges.size(), size_t(2) * copies);
    for (const Range& range : halves.ranges)
      for (uint32_t i = 0; i < range.count; ++i)
        if (halves.items[range.offset + i] / half != halves.items[range.offset] / half)
          return false;
    return true;
  }
};

TEST(SplitCells, the_largest_nodes_are_split_where_boxes_overlap_least) {
  for (const uint32_t half : {10000u, 40000u}) {
    const Layers layers(half, 1);
    EXPECT_FALSE(layers.are_parted(0.0f)) << half;
    EXPECT_TRUE(layers.are_parted(0.5f)) << half;
  }
}

// Nodes in a block, and such as are split by cells.
TEST(SplitCells, overlap_counts_below_the_root) {
  for (const uint32_t half : {500u, 10000u, 40000u}) {
    const Layers layers(half, 2);
    EXPECT_FALSE(layers.are_parted(0.0f)) << half;
    EXPECT_TRUE(layers.are_parted(0.5f)) << half;
  }
}

TEST(SplitCells, overlap_and_connections_count_together) {
  for (const uint32_t half : {1000u, 40000u}) {
    Layers layers(half, 2);
    layers.connect(0.01f);
    EXPECT_FALSE(layers.are_parted(0.0f)) << half;
    EXPECT_TRUE(layers.are_parted(0.5f)) << half;
    layers.connect(10.0f);
    EXPECT_FALSE(layers.are_parted(0.5f)) << half;
  }
}

}  // namespace
}  // namespace umbel
