#include <gtest/gtest.h>

#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Bvh2 built(const std::vector<Aabb>& boxes, Builder builder, uint32_t leaf_size) {
  Config config;
  config.builder = builder;
  config.max_leaf_size = leaf_size;
  return build(boxes, config);
}

TEST(Reinsert, gives_a_sound_tree_that_costs_no_more) {
  std::vector<NamedBoxes> inputs = nasty_boxes();
  inputs.push_back({"random", random_boxes(20000, 1)});
  inputs.push_back({"large", random_boxes(5000, 2, 0.5f)});
  for (const NamedBoxes& input : inputs) {
    for (const Builder builder : {Builder::kLbvh, Builder::kSweep}) {
      for (const uint32_t leaf_size : {1u, 8u}) {
        SCOPED_TRACE(input.name + ", " + std::string(name(builder)));
        const Bvh2 before = built(input.boxes, builder, leaf_size);
        Bvh2 tree = before;
        double cost = sah_cost(tree);
        for (int round = 0; round < 3; ++round) {
          reinsert(tree, 1);
          ASSERT_NO_THROW(check(tree, uint32_t(input.boxes.size())));
          expect_exact_boxes(tree, input.boxes);
          ASSERT_LE(sah_cost(tree), cost * (1 + 1e-9));
          cost = sah_cost(tree);
        }
        EXPECT_EQ(tree.nodes.size(), before.nodes.size());
      }
    }
  }
}

TEST(Reinsert, does_not_depend_on_the_threads) {
  const Bvh2 before = built(random_boxes(30000, 3), Builder::kLbvh, 1);
  Bvh2 one = before, two = before, eight = before;
  reinsert(one, 4, with_thread_count(1));
  reinsert(two, 4, with_thread_count(2));
  reinsert(eight, 4, with_thread_count(8));
  expect_same(one, two);
  expect_same(one, eight);
}

TEST(Reinsert, makes_a_linear_tree_better_than_the_sweep_on_long_boxes) {
  auto boxes = random_boxes(8000, 4);
  for (size_t i = 0; i < boxes.size(); i += 10) boxes[i].max.x += 0.5f;
  const double sweep = sah_cost(built(boxes, Builder::kSweep, 1));
  Bvh2 tree = built(boxes, Builder::kLbvh, 1);
  const double linear = sah_cost(tree);
  reinsert(tree, 2);
  EXPECT_LT(sah_cost(tree), 0.95 * linear);
  reinsert(tree, 64);
  EXPECT_LT(sah_cost(tree), sweep);
}

TEST(Reinsert, stops_where_nothing_is_gained) {
  Bvh2 tree = built(random_boxes(300, 5), Builder::kSweep, 1);
  for (int k = 0; k < 20; ++k) reinsert(tree, 64);
  const Bvh2 last = tree;
  reinsert(tree, 64);
  expect_same(tree, last);
}

TEST(Reinsert, runs_after_any_builder) {
  const auto boxes = random_boxes(5000, 6);
  for (const Builder builder : builders()) {
    if (builder == Builder::kSpatial) continue;
    Config config;
    config.builder = builder;
    const double before = sah_cost(build(boxes, config));
    config.reinsertion_rounds = 2;
    const Bvh2 tree = build(boxes, config);
    SCOPED_TRACE(name(builder));
    ASSERT_NO_THROW(check(tree, uint32_t(boxes.size())));
    EXPECT_LE(sah_cost(tree), before * (1 + 1e-6));
  }
}

TEST(Reinsert, keeps_parts_of_triangles) {
  const Mesh mesh = shapes::soup(2000, 7);
  Config config;
  config.builder = Builder::kSpatial;
  const Bvh2 before = build(mesh.view(), config);
  Bvh2 tree = before;
  reinsert(tree, 8);
  check(tree, 2000, true);
  EXPECT_LE(sah_cost(tree), sah_cost(before));
  auto a = before.primitives, b = tree.primitives;
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  EXPECT_EQ(a, b);
}

TEST(Reinsert, takes_trees_without_nodes) {
  Bvh2 tree;
  reinsert(tree, 3);
  EXPECT_TRUE(tree.nodes.empty());
}

}  // namespace
}  // namespace umbel::bvh
