#include <gtest/gtest.h>

#include <ctime>

#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config insertion() {
  Config config;
  config.builder = Builder::kInsertion;
  return config;
}

double cost_of(const std::vector<Aabb>& boxes, Builder builder) {
  Config config;
  config.builder = builder;
  return sah_cost(build(boxes, config));
}

/// Four pairs of boxes, each pair far from the others: whatever the order, pairs stay together.
TEST(Insertion, neighbors_become_siblings) {
  std::vector<Aabb> boxes;
  for (int i = 0; i < 8; ++i) {
    const int layer = i / 4;
    const float x = 100.0f * float(i % 4), y = 100.0f * float(i % 2), z = float(layer);
    boxes.push_back({{x, y, z}, {x + 1, y + 1, z + 1}});
  }
  Config config = insertion();
  config.max_leaf_size = 1;
  const Bvh2 tree = build(boxes, config);
  int pairs = 0;
  for (const Node& node : tree.nodes) {
    if (node.is_leaf()) continue;
    const Node &left = tree.nodes[node.first], &right = tree.nodes[node.first + 1];
    if (!left.is_leaf() || !right.is_leaf()) continue;
    EXPECT_EQ(tree.primitives[left.first] % 4, tree.primitives[right.first] % 4);
    ++pairs;
  }
  EXPECT_EQ(pairs, 4);
}

/// Where each box holds all before it, every search for a place could go through all of them.
TEST(Insertion, nested_boxes_do_not_take_the_square_of_their_number) {
  std::vector<Aabb> boxes;
  for (int i = 1; i <= 100000; ++i) {
    const auto x = float(i);
    boxes.push_back({{-x, -x, -x}, {x, x, x}});
  }
  const std::clock_t began = std::clock();
  const double cost = cost_of(boxes, Builder::kInsertion);
  EXPECT_LT(double(std::clock() - began) / CLOCKS_PER_SEC, 60);
  EXPECT_LT(cost, 1.2 * cost_of(boxes, Builder::kSweep));
}

class InsertionScenes : public ::testing::TestWithParam<const char*> {};

TEST_P(InsertionScenes, are_near_the_sweep) {
  const auto mesh = umbel::testing::read_mesh(GetParam());
  if (!mesh) GTEST_SKIP() << "no " << GetParam();
  const std::vector<Aabb> boxes = triangle_boxes(mesh->view());
  const double cost = cost_of(boxes, Builder::kInsertion);
  EXPECT_LT(cost, cost_of(boxes, Builder::kLbvh));
  EXPECT_LT(cost, 1.15 * cost_of(boxes, Builder::kSweep));
}

INSTANTIATE_TEST_SUITE_P(RealMeshes, InsertionScenes,
                         ::testing::Values("bunny_69k.ply", "sibenik_75k.ply",
                                           "conference_331k.ply"));

}  // namespace
}  // namespace umbel::bvh
