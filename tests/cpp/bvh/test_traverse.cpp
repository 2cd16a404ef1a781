#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "umbel/bvh_traverse.hpp"

namespace umbel::bvh {
namespace {

struct Balls {
  std::vector<Sphere> spheres;
  std::vector<Aabb> boxes;
};

Balls random_balls(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Balls balls;
  for (size_t i = 0; i < count; ++i) {
    const Sphere s{{unit(random), unit(random), unit(random)}, 0.03f * unit(random)};
    balls.spheres.push_back(s);
    balls.boxes.push_back({{s.center.x - s.radius, s.center.y - s.radius, s.center.z - s.radius},
                           {s.center.x + s.radius, s.center.y + s.radius, s.center.z + s.radius}});
  }
  return balls;
}

float distance2(const Aabb& box, const Vec3& p) {
  const auto outside = [](float low, float high, float x) {
    return std::max({low - x, x - high, 0.0f});
  };
  const float x = outside(box.min.x, box.max.x, p.x), y = outside(box.min.y, box.max.y, p.y),
              z = outside(box.min.z, box.max.z, p.z);
  return x * x + y * y + z * z;
}

TEST(BvhTraverse, an_ordered_visit_finds_the_nearest_and_tests_few) {
  const Balls balls = random_balls(2000, 1);
  for (const Builder builder : builders()) {
    if (builder == Builder::kSpatial) continue;  // takes triangles
    Config config;
    config.builder = builder;
    const Bvh2 tree = build(balls.boxes, config);
    std::mt19937 random(2);
    std::uniform_real_distribution<float> unit(-0.5f, 1.5f);
    size_t tested = 0;
    for (int i = 0; i < 200; ++i) {
      const Vec3 p{unit(random), unit(random), unit(random)};
      float nearest = std::numeric_limits<float>::infinity(), truth = nearest;
      for (const Aabb& box : balls.boxes) truth = std::min(truth, distance2(box, p));
      const float limit = traverse_ordered(
          tree, [&](const Node& node) { return distance2(node.box(), p); },
          [&](std::span<const uint32_t> primitives) {
            tested += primitives.size();
            for (const uint32_t k : primitives)
              nearest = std::min(nearest, distance2(balls.boxes[k], p));
            return nearest;
          });
      ASSERT_EQ(nearest, truth);
      ASSERT_EQ(limit, truth);
    }
    EXPECT_LT(tested, 200u * 400u);
  }
}

TEST(BvhTraverse, an_unordered_visit_finds_everything_in_a_region) {
  const Balls balls = random_balls(1000, 3);
  const Bvh2 tree = build(balls.boxes);
  const Vec3 p{0.4f, 0.5f, 0.6f};
  const float limit = 0.02f;
  std::vector<uint32_t> found, truth;
  for (uint32_t i = 0; i < balls.boxes.size(); ++i)
    if (distance2(balls.boxes[i], p) <= limit) truth.push_back(i);
  EXPECT_TRUE(traverse(
      tree, [&](const Node& node) { return distance2(node.box(), p) <= limit; },
      [&](std::span<const uint32_t> primitives) {
        for (const uint32_t k : primitives)
          if (distance2(balls.boxes[k], p) <= limit) found.push_back(k);
        return true;
      }));
  std::sort(found.begin(), found.end());
  EXPECT_EQ(found, truth);
  EXPECT_GT(truth.size(), 5u);
}

TEST(BvhTraverse, visits_end_when_told_to) {
  const Bvh2 tree = build(random_balls(1000, 4).boxes);
  size_t leaves = 0;
  const auto everywhere = [](const Node&) { return true; };
  EXPECT_FALSE(traverse(tree, everywhere, [&](auto) { return ++leaves < 3; }));
  EXPECT_EQ(leaves, 3u);
  leaves = 0;
  traverse_ordered(
      tree, [](const Node&) { return 0.0f; },
      [&](auto) {
        ++leaves;
        return -std::numeric_limits<float>::infinity();
      });
  EXPECT_EQ(leaves, 1u);
}

TEST(BvhTraverse, keys_that_are_not_numbers_leave_nodes_out) {
  const Bvh2 tree = build(random_balls(100, 5).boxes);
  for (const double key : {std::nan(""), double(INFINITY)}) {
    size_t leaves = 0;
    traverse_ordered(
        tree, [&](const Node& node) { return &node == tree.nodes.data() ? 0.0 : key; },
        [&](auto) {
          ++leaves;
          return double(INFINITY);
        });
    EXPECT_EQ(leaves, 0u);
  }
}

TEST(BvhTraverse, an_empty_tree_has_nothing_to_visit) {
  const Bvh2 tree;
  EXPECT_TRUE(traverse(tree, [](const Node&) { return true; }, [](auto) { return false; }));
  traverse_ordered(
      tree, [](const Node&) { return 1.0f; },
      [](auto) {
        ADD_FAILURE();
        return 0.0f;
      });
}

/// Leaves hang off one long branch, the right child of each level being the next one.
Bvh2 chain(uint32_t levels) {
  Bvh2 tree;
  tree.nodes.assign(1, {{0, 0, 0}, 1, {1, 1, 1}, 0});
  for (uint32_t i = 0; i < levels; ++i) {
    const auto next = static_cast<uint32_t>(tree.nodes.size()) + 2;
    const bool is_last = i + 1 == levels;
    // The inner child is on the left, so that its sibling waits.
    tree.nodes.push_back({{0, 0, 0}, is_last ? i : next, {1, 1, 1}, is_last ? 1u : 0u});
    tree.nodes.push_back({{0, 0, 0}, i, {1, 1, 1}, 1});
    tree.primitives.push_back(i);
  }
  return tree;
}

TEST(BvhTraverse, trees_may_be_as_deep_as_builders_make_them_and_no_deeper) {
  const auto everywhere = [](const Node&) { return true; };
  const auto zero = [](const Node&) { return 0.0f; };
  const Bvh2 deep = chain(255);
  size_t visited = 0, ordered = 0;
  traverse(deep, everywhere, [&](auto) { return ++visited > 0; });
  traverse_ordered(deep, zero, [&](auto) { return static_cast<float>(++ordered); });
  EXPECT_EQ(visited, 256u);
  EXPECT_EQ(ordered, 256u);
  const Bvh2 too_deep = chain(300);
  EXPECT_THROW(traverse(too_deep, everywhere, [](auto) { return true; }), Error);
  EXPECT_THROW(traverse_ordered(too_deep, zero, [](auto) { return 1.0f; }), Error);
}

}  // namespace
}  // namespace umbel::bvh
