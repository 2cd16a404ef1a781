#include <algorithm>
#include <memory>

#include "base/team.hpp"
#include "bvh/tree/treelet_join.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

const LeafRule kSingle{CostModel{3, 2}, 1};

std::vector<JoinItem> items_of(const std::vector<Aabb>& boxes, const LeafRule& rule = kSingle) {
  std::vector<JoinItem> items;
  for (uint32_t i = 0; i < boxes.size(); ++i)
    items.push_back({boxes[i], Subtree::of_primitive(i), 1, rule.leaf_cost(boxes[i], 1), i});
  return items;
}

float union_area(const Aabb& a, const Aabb& b) { return area_of(united(a, b)); }

/// Each item and each join but the last is joined once.
void expect_tree(const std::vector<Join>& joins, uint32_t count) {
  std::vector<uint32_t> uses(2 * count - 1);
  for (uint32_t i = 0; i + 1 < count; ++i)
    for (const uint32_t part : {joins[i].left, joins[i].right}) {
      ASSERT_LT(part, count + i);
      ++uses[part];
    }
  for (uint32_t i = 0; i + 2 < 2 * count; ++i) EXPECT_EQ(uses[i], 1u) << i;
}

TEST(TreeletJoin, agglomeration_joins_the_nearest_two_each_time) {
  for (const uint32_t count : {2u, 3u, 7u, 64u, kMostJoined}) {
    const std::vector<Aabb> boxes = random_boxes(count, count);
    const std::vector<JoinItem> items = items_of(boxes);
    std::vector<Join> joins(count);
    TreeletAgglomeration().run(items.data(), count, joins.data());
    expect_tree(joins, count);
    std::vector<Aabb> nodes = boxes;
    std::vector<bool> is_open(2 * size_t{count} - 1);
    std::fill_n(is_open.begin(), count, true);
    for (uint32_t i = 0; i + 1 < count; ++i) {
      float least = std::numeric_limits<float>::infinity();
      for (uint32_t a = 0; a < nodes.size(); ++a)
        for (uint32_t b = 0; b < a; ++b)
          if (is_open[a] && is_open[b]) least = std::min(least, union_area(nodes[a], nodes[b]));
      const Aabb made = united(nodes[joins[i].left], nodes[joins[i].right]);
      EXPECT_EQ(area_of(made), least) << count << " items, join " << i;
      is_open[joins[i].left] = is_open[joins[i].right] = false;
      is_open[nodes.size()] = true;
      nodes.push_back(made);
    }
  }
}

TEST(TreeletJoin, equal_items_become_a_balanced_tree) {
  const uint32_t count = 64;
  const std::vector<JoinItem> items = items_of(std::vector<Aabb>(count, {{0, 0, 0}, {1, 1, 1}}));
  std::vector<Join> joins(count);
  TreeletAgglomeration().run(items.data(), count, joins.data());
  expect_tree(joins, count);
  std::vector<uint32_t> height(2 * count - 1);
  for (uint32_t i = 0; i + 1 < count; ++i)
    height[count + i] = 1 + std::max(height[joins[i].left], height[joins[i].right]);
  EXPECT_LE(height[2 * count - 2], 8u);
}

TEST(TreeletJoin, sweep_splits_where_areas_times_weights_are_least) {
  for (const uint32_t count : {2u, 3u, 9u, kMostJoined}) {
    const std::vector<JoinItem> items = items_of(random_boxes(count, 2 * count));
    std::vector<Join> joins(count);
    const auto sweep = std::make_unique<TreeletSweep>();
    sweep->run(SerialTeam{}, items.data(), count, joins.data());
    expect_tree(joins, count);
  }
  // Two groups far apart are told apart at the top.
  std::vector<Aabb> boxes = random_boxes(10, 1);
  for (size_t i = 0; i < boxes.size(); i += 2) boxes[i].min.y += 100, boxes[i].max.y += 100;
  const std::vector<JoinItem> items = items_of(boxes);
  std::vector<Join> joins(10);
  const auto sweep = std::make_unique<TreeletSweep>();
  sweep->run(SerialTeam{}, items.data(), 10, joins.data());
  std::vector<uint32_t> parities(19);
  for (uint32_t i = 0; i < 10; ++i) parities[i] = 1u << i % 2;
  for (uint32_t i = 0; i < 9; ++i)
    parities[10 + i] = parities[joins[i].left] | parities[joins[i].right];
  EXPECT_NE(parities[joins[8].left], 3u);
  EXPECT_NE(parities[joins[8].right], 3u);
}

/// The tree below `subtree`: its primitives, in their order.
void collect(const std::vector<Merge>& merges, Subtree subtree, std::vector<uint32_t>& found) {
  if (subtree.is_primitive()) {
    found.push_back(subtree.index());
    return;
  }
  collect(merges, merges[subtree.index()].left, found);
  collect(merges, merges[subtree.index()].right, found);
}

TEST(TreeletJoin, forwards_as_many_subtrees_as_asked_for_which_hold_all_items) {
  const uint32_t count = 50;
  const std::vector<JoinItem> items = items_of(random_boxes(count, 5));
  for (const uint32_t most : {1u, 2u, 8u, count, count + 9}) {
    const auto join = std::make_unique<TreeletJoin>();
    const auto agglomeration = std::make_unique<TreeletAgglomeration>();
    join->begin(count);
    for (uint32_t i = 0; i < count; ++i) join->put(i, items[i]);
    join->agglomerate(SerialTeam{}, kSingle, *agglomeration);
    std::vector<Merge> merges(count);
    std::vector<JoinItem> out(std::max(most, count));
    const uint32_t left = join->forward(most, merges.data(), out.data());
    EXPECT_EQ(left, std::min(most, count));
    std::vector<uint32_t> found;
    for (uint32_t i = 0; i < left; ++i) {
      const size_t before = found.size();
      collect(merges, out[i].subtree, found);
      EXPECT_EQ(found.size() - before, out[i].count);
      Aabb box;
      for (size_t k = before; k < found.size(); ++k) extend(box, items[found[k]].box);
      EXPECT_EQ(box, out[i].box);
    }
    std::sort(found.begin(), found.end());
    for (uint32_t i = 0; i < count; ++i) EXPECT_EQ(found[i], i);
  }
}

TEST(TreeletJoin, keeps_the_cheaper_of_agglomeration_and_sweep) {
  // Boxes within boxes: agglomeration makes a list of what a sweep divides.
  const LeafRule rule{CostModel{1, 2}, 1};
  for (const uint32_t seed : {1u, 2u, 3u}) {
    const std::vector<JoinItem> items = items_of(random_boxes(40, seed, 0.5f), rule);
    const auto cost = [&](bool by_sweep) {
      const auto join = std::make_unique<TreeletJoin>();
      const auto agglomeration = std::make_unique<TreeletAgglomeration>();
      const auto sweep = std::make_unique<TreeletSweep>();
      join->begin(40);
      for (uint32_t i = 0; i < 40; ++i) join->put(i, items[i]);
      join->agglomerate(SerialTeam{}, rule, *agglomeration);
      if (by_sweep) join->sweep(SerialTeam{}, rule, *sweep);
      std::vector<Merge> merges(40);
      JoinItem root{};
      EXPECT_EQ(join->forward(1, merges.data(), &root), 1u);
      return root.cost;
    };
    EXPECT_LE(cost(true), cost(false));
  }
}

}  // namespace
}  // namespace umbel::bvh
