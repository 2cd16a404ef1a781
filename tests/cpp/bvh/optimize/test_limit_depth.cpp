#include <algorithm>

#include "bvh/tree/config.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

/// A list: the left child of each inner node is a leaf of one primitive.
Bvh2 list_of(const std::vector<Aabb>& boxes) {
  const auto count = static_cast<uint32_t>(boxes.size());
  Bvh2 tree;
  tree.nodes.resize(2 * size_t{count} - 1);
  for (uint32_t i = 0; i < count; ++i) tree.primitives.push_back(i);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t leaf = i + 1 < count ? 2 * i + 1 : 2 * i;
    tree.nodes[leaf] = {boxes[i].min, i, boxes[i].max, 1};
  }
  for (uint32_t i = count - 1; i-- > 0;) {
    const Node &left = tree.nodes[2 * i + 1], &right = tree.nodes[2 * i + 2];
    tree.nodes[2 * i] = {{std::min(left.min.x, right.min.x), std::min(left.min.y, right.min.y),
                          std::min(left.min.z, right.min.z)},
                         2 * i + 1,
                         {std::max(left.max.x, right.max.x), std::max(left.max.y, right.max.y),
                          std::max(left.max.z, right.max.z)},
                         0};
  }
  return tree;
}

/// The leaves from left to right.
std::vector<uint32_t> leaves_of(const Bvh2& tree) {
  std::vector<uint32_t> firsts, stack{0};
  while (!stack.empty()) {
    const Node& node = tree.nodes[stack.back()];
    stack.pop_back();
    if (node.is_leaf()) {
      firsts.push_back(node.first);
    } else {
      stack.push_back(node.first + 1);
      stack.push_back(node.first);
    }
  }
  return firsts;
}

TEST(LimitDepth, lists_keep_to_any_depth_that_their_leaves_fit_in) {
  const std::vector<Aabb> boxes = random_boxes(200, 3);
  const Bvh2 list = list_of(boxes);
  ASSERT_EQ(statistics(list).max_depth, 199u);
  for (const uint32_t depth : {8u, 9u, 20u, 100u, 198u}) {
    Bvh2 tree = list;
    limit_depth(tree, depth);
    SCOPED_TRACE(depth);
    ASSERT_NO_THROW(check(tree, 200));
    expect_exact_boxes(tree, boxes);
    EXPECT_LE(statistics(tree).max_depth, depth);
    EXPECT_EQ(tree.nodes.size(), list.nodes.size());
    EXPECT_EQ(leaves_of(tree), leaves_of(list));
  }
}

TEST(LimitDepth, keeps_the_top_as_long_as_leaves_fit_below_it) {
  const std::vector<Aabb> boxes = random_boxes(200, 3);
  const Bvh2 list = list_of(boxes);
  Bvh2 tree = list;
  // 12 levels: the top of the list stays until what is left needs the remaining levels.
  limit_depth(tree, 12);
  uint32_t kept = 0;
  for (uint32_t from = 0, to = 0; tree.nodes[tree.nodes[to].first].is_leaf();) {
    EXPECT_EQ(tree.nodes[to].box(), list.nodes[from].box());
    from = list.nodes[from].first + 1;
    to = tree.nodes[to].first + 1;
    ++kept;
  }
  EXPECT_GE(kept, 3u);
  EXPECT_LE(kept, 5u);
}

TEST(LimitDepth, trees_within_the_limit_stay_as_they_are) {
  const std::vector<Aabb> boxes = random_boxes(2000, 4);
  const Bvh2 tree = build(boxes);
  Bvh2 same = tree;
  limit_depth(same, statistics(tree).max_depth);
  expect_same(tree, same);
  const Bvh2 list = list_of(random_boxes(100, 1));
  same = list;
  limit_depth(same, 99);
  expect_same(list, same);
  Bvh2 empty;
  limit_depth(empty, 8);
  EXPECT_TRUE(empty.nodes.empty());
}

}  // namespace
}  // namespace umbel::bvh
