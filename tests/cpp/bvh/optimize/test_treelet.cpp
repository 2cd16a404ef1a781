#include <gtest/gtest.h>

#include <algorithm>

#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config atrbvh(uint32_t size = 9, uint32_t rounds = 2) {
  Config config;
  config.builder = Builder::kAtrbvh;
  config.treelet_size = size;
  config.treelet_rounds = rounds;
  return config;
}

Config with(Builder builder) {
  Config config;
  config.builder = builder;
  return config;
}

double cost_of(const std::vector<Aabb>& boxes, const Config& config) {
  return sah_cost(build(boxes, config), config.cost);
}

TEST(Atrbvh, each_round_makes_the_tree_cheaper) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  double before = cost_of(boxes, with(Builder::kLbvh));
  for (const uint32_t rounds : {1u, 2u, 3u}) {
    const double cost = cost_of(boxes, atrbvh(9, rounds));
    EXPECT_LT(cost, before);
    before = cost;
  }
}

TEST(Atrbvh, begins_with_a_tree_of_splits_unless_told_otherwise) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  Config published = atrbvh();
  published.atrbvh_bits = 0;
  EXPECT_LT(cost_of(boxes, atrbvh()), cost_of(boxes, published));
  EXPECT_LT(cost_of(boxes, published), cost_of(boxes, with(Builder::kLbvh)));
}

TEST(Atrbvh, trees_cost_little_more_than_the_sweeps) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  EXPECT_LT(cost_of(boxes, atrbvh()), 1.05 * cost_of(boxes, with(Builder::kSweep)));
}

TEST(RestructureTreelets, any_builders_tree_becomes_no_dearer_and_stays_sound) {
  const std::vector<Aabb> boxes = random_boxes(20000, 2);
  for (const Builder builder : builders()) {
    if (builder == Builder::kSpatial) continue;
    SCOPED_TRACE(name(builder));
    Bvh2 tree = build(boxes, with(builder));
    const double before = sah_cost(tree);
    restructure_treelets(tree, 9, 2, {});
    ASSERT_NO_THROW(check(tree, 20000));
    expect_exact_boxes(tree, boxes);
    EXPECT_LE(sah_cost(tree), before * (1 + 1e-6));
  }
}

TEST(RestructureTreelets, trees_with_repeated_primitives_keep_them) {
  const Mesh mesh = shapes::blob(5, 4);
  Bvh2 tree = build(mesh.view(), with(Builder::kSpatial));
  std::vector<uint32_t> primitives = tree.primitives;
  restructure_treelets(tree, 9, 1, {});
  ASSERT_NO_THROW(check(tree, uint32_t(mesh.triangles.size()), true));
  std::vector<uint32_t> after = tree.primitives;
  std::sort(primitives.begin(), primitives.end());
  std::sort(after.begin(), after.end());
  EXPECT_EQ(after, primitives);
}

TEST(RestructureTreelets, gives_the_same_for_any_threads) {
  for (const NamedBoxes& input : nasty_boxes()) {
    SCOPED_TRACE(input.name);
    const Bvh2 tree = build(input.boxes, with(Builder::kLbvh));
    Bvh2 one = tree, eight = tree;
    restructure_treelets(one, 7, 2, {}, with_thread_count(1));
    restructure_treelets(eight, 7, 2, {}, with_thread_count(8));
    ASSERT_NO_THROW(check(one, uint32_t(input.boxes.size())));
    expect_same(one, eight);
  }
}

TEST(RestructureTreelets, small_trees_and_bad_arguments) {
  Bvh2 none;
  restructure_treelets(none, 9, 2, {});
  EXPECT_TRUE(none.nodes.empty());
  Bvh2 one = build(random_boxes(1, 1));
  restructure_treelets(one, 9, 2, {});
  EXPECT_EQ(one.nodes.size(), 1u);
  EXPECT_THROW(restructure_treelets(one, 2, 1, {}), Error);
  EXPECT_THROW(restructure_treelets(one, 16, 1, {}), Error);
  EXPECT_THROW(restructure_treelets(one, 9, 17, {}), Error);
  EXPECT_NO_THROW(restructure_treelets(one, 9, 0, {}));
}

}  // namespace
}  // namespace umbel::bvh
