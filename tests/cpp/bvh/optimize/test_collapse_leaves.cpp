#include <algorithm>
#include <set>

#include "bvh/tree/leaf_order.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Bvh2 tree_of_single_leaves(const std::vector<Aabb>& boxes, Builder builder = Builder::kSweep) {
  Config config;
  config.builder = builder;
  config.max_leaf_size = 1;
  return build(boxes, config);
}

double half_area(const Node& n) {
  const double x = double(n.max.x) - double(n.min.x), y = double(n.max.y) - double(n.min.y),
               z = double(n.max.z) - double(n.min.z);
  return x * y + y * z + z * x;
}

/// The least cost of the subtree of `index` with any of its inner nodes as leaves.
std::pair<double, uint32_t> least_cost(const Bvh2& tree, uint32_t index, const CostModel& cost,
                                       uint32_t most) {
  const Node& node = tree.nodes[index];
  const double area = half_area(node);
  if (node.is_leaf()) return {area * double(cost.intersection) * node.count, node.count};
  const auto left = least_cost(tree, node.first, cost, most);
  const auto right = least_cost(tree, node.first + 1, cost, most);
  const uint32_t count = left.second + right.second;
  double least = area * double(cost.traversal) + left.first + right.first;
  if (count <= most) least = std::min(least, area * double(cost.intersection) * count);
  return {least, count};
}

TEST(CollapseLeaves, gives_the_least_cost_of_all_ways) {
  const std::vector<Aabb> boxes = random_boxes(2000, 3, 0.2f);
  for (const uint32_t most : {1u, 2u, 8u, 255u}) {
    for (const CostModel cost : {CostModel{3, 2}, CostModel{1, 1}, CostModel{0.1f, 5}}) {
      Bvh2 tree = tree_of_single_leaves(boxes);
      const double before = sah_cost(tree, cost);
      const double least = least_cost(tree, 0, cost, most).first / half_area(tree.nodes[0]);
      collapse_leaves(tree, cost, most);
      check(tree, uint32_t(boxes.size()));
      expect_exact_boxes(tree, boxes);
      EXPECT_NEAR(sah_cost(tree, cost), least, 1e-9 * least);
      EXPECT_LE(sah_cost(tree, cost), before * (1 + 1e-12));
      for (const Node& node : tree.nodes) EXPECT_LE(node.count, most);
    }
  }
}

TEST(CollapseLeaves, is_done_already_in_what_builders_give) {
  for (const Builder builder : {Builder::kSweep, Builder::kBinned}) {
    for (const NamedBoxes& input : nasty_boxes()) {
      SCOPED_TRACE(input.name);
      Config config;
      config.builder = builder;
      Bvh2 tree = build(input.boxes, config);
      const double before = sah_cost(tree, config.cost);
      collapse_leaves(tree, config.cost, config.max_leaf_size);
      EXPECT_NEAR(sah_cost(tree, config.cost), before, 1e-3 * before);
    }
  }
}

TEST(CollapseLeaves, keeps_what_repeats_below_a_node_once) {
  // Two halves of one large box, and a small box beside them.
  Bvh2 tree;
  tree.nodes = {{{0, 0, 0}, 1, {4, 1, 1}, 0},
                {{0, 0, 0}, 3, {2, 1, 1}, 0},
                {{3, 0, 0}, 2, {4, 1, 1}, 1},
                {{0, 0, 0}, 0, {1, 1, 1}, 1},
                {{1, 0, 0}, 1, {2, 1, 1}, 1}};
  tree.primitives = {0, 0, 1};
  check(tree, 2, true);
  collapse_leaves(tree, {}, 8);
  check(tree, 2);
  EXPECT_EQ(std::set<uint32_t>(tree.primitives.begin(), tree.primitives.end()).size(), 2u);
}

TEST(LeafOrder, is_ascending_and_touches_nothing_else) {
  std::mt19937 random(5);
  for (int k = 0; k < 2000; ++k) {
    const uint32_t count = 1 + random() % 40;
    std::vector<uint32_t> leaf(count + 2);
    for (uint32_t& primitive : leaf) primitive = random() % 20;
    std::vector<uint32_t> expected = leaf;
    std::sort(expected.begin() + 1, expected.end() - 1);
    sort_leaf(leaf.data() + 1, count);
    EXPECT_EQ(leaf, expected);
  }
}

TEST(Reorder, is_depth_first_and_keeps_the_tree) {
  const std::vector<Aabb> boxes = random_boxes(3000, 4);
  Bvh2 tree = tree_of_single_leaves(boxes);
  // A tree in another order: breadth-first.
  Bvh2 other;
  other.primitives = tree.primitives;
  other.nodes.push_back(tree.nodes[0]);
  for (size_t i = 0; i < other.nodes.size(); ++i) {
    if (other.nodes[i].is_leaf()) continue;
    const uint32_t left = other.nodes[i].first;
    other.nodes[i].first = uint32_t(other.nodes.size());
    other.nodes.push_back(tree.nodes[left]);
    other.nodes.push_back(tree.nodes[left + 1]);
  }
  check(other, 3000);
  reorder(other);
  reorder(tree);
  expect_same(other, tree);
  check(tree, 3000);
  expect_exact_boxes(tree, boxes);
  // The larger child's descendants come right after its pair; primitives follow the leaves.
  uint32_t next_primitive = 0;
  std::vector<uint32_t> stack{0};
  uint32_t next = 1;
  while (!stack.empty()) {
    const Node& node = tree.nodes[stack.back()];
    stack.pop_back();
    if (node.is_leaf()) {
      EXPECT_EQ(node.first, next_primitive);
      next_primitive += node.count;
      continue;
    }
    ASSERT_EQ(node.first, next);
    next += 2;
    const bool right_first =
        half_area(tree.nodes[node.first]) < half_area(tree.nodes[node.first + 1]);
    stack.push_back(node.first + (right_first ? 0 : 1));
    stack.push_back(node.first + (right_first ? 1 : 0));
  }
}

TEST(SahCost, is_that_of_a_tree_counted_by_hand) {
  Bvh2 tree;
  tree.nodes = {
      {{0, 0, 0}, 1, {4, 1, 1}, 0}, {{0, 0, 0}, 0, {1, 1, 1}, 3}, {{2, 0, 0}, 3, {4, 1, 1}, 1}};
  tree.primitives = {0, 1, 2, 3};
  EXPECT_DOUBLE_EQ(sah_cost(tree, {3, 2}), 3 + (6.0 * 3 / 9 + 2.0 * 5 / 9));
  EXPECT_EQ(sah_cost(Bvh2{}), 0.0);
  const Statistics s = statistics(tree);
  EXPECT_EQ(s.nodes, 3u);
  EXPECT_EQ(s.leaves, 2u);
  EXPECT_EQ(s.max_depth, 1u);
  EXPECT_EQ(s.references, 4u);
  for (Node& node : tree.nodes) node.min = node.max = {1, 1, 1};
  EXPECT_DOUBLE_EQ(sah_cost(tree, {3, 2}), 3 + 6 + 2);
}

}  // namespace
}  // namespace umbel::bvh
