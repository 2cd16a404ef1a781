#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "bvh/oracle.hpp"
#include "bvh/ploc.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config ploc(uint32_t radius) {
  Config config;
  config.builder = Builder::kPloc;
  config.ploc_radius = radius;
  return config;
}

double cost_of(const std::vector<Aabb>& boxes, const Config& config) {
  return sah_cost(build(boxes, config), config.cost);
}

TEST(Ploc, trees_are_sound_for_every_radius) {
  for (const uint32_t radius : {1u, 2u, 16u, 128u}) {
    SCOPED_TRACE(radius);
    expect_sound_builder(ploc(radius));
  }
}

TEST(Ploc, trees_keep_leaf_size_and_depth) {
  Config config = ploc(16);
  config.max_leaf_size = 1;
  config.max_depth = 16;
  expect_sound_builder(config);
}

TEST(Ploc, radius_from_1_to_128_is_taken) {
  for (const uint32_t radius : {0u, 129u}) {
    try {
      build(random_boxes(10, 1), ploc(radius));
      FAIL() << radius;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("ploc_radius is " + std::to_string(radius)),
                std::string::npos);
    }
  }
}

std::vector<Aabb> inner_boxes(const Bvh2& tree) {
  std::vector<Aabb> boxes;
  for (const Node& node : tree.nodes)
    if (!node.is_leaf()) boxes.push_back(node.box());
  std::sort(boxes.begin(), boxes.end(), [](const Aabb& a, const Aabb& b) {
    const auto key = [](const Aabb& v) {
      return std::tie(v.min.x, v.min.y, v.min.z, v.max.x, v.max.y, v.max.z);
    };
    return key(a) < key(b);
  });
  return boxes;
}

TEST(Ploc, with_all_in_reach_is_agglomerative_clustering) {
  // Clusters that are nearest to each other stay so until they merge, in whatever order others do.
  const std::vector<Aabb> boxes = random_boxes(120, 5);
  Config config = ploc(128);
  config.max_leaf_size = 1;
  Config one_by_one = config;
  one_by_one.builder = Builder::kAgglomerative;
  EXPECT_EQ(inner_boxes(build(boxes, config)), inner_boxes(build(boxes, one_by_one)));
}

TEST(Ploc, identical_clusters_all_find_a_partner) {
  const std::vector<PlocCluster> clusters(100, {{{0, 0, 0}, {1, 1, 1}}, {0}, 1});
  for (uint32_t i = 0; i < 100; ++i) EXPECT_EQ(nearest_within(clusters.data(), 100, i, 16), i ^ 1);
}

TEST(Ploc, boxes_that_grow_from_one_to_the_next_take_few_rounds) {
  // Each is nearest to the one before, so but for the first two none finds a partner.
  std::vector<Aabb> boxes;
  for (int i = 0; i < 200000; ++i) {
    const float size = 1 + float(i) * 1e-3f;
    boxes.push_back({{-size, -size, -size}, {size, size, size}});
  }
  const Bvh2 tree = build(boxes, ploc(16));
  EXPECT_NO_THROW(check(tree, 200000));
}

TEST(Ploc, a_wider_radius_makes_better_trees) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  Config linear;
  linear.builder = Builder::kLbvh;
  EXPECT_LT(cost_of(boxes, ploc(16)), cost_of(boxes, linear));
  EXPECT_LT(cost_of(boxes, ploc(32)), cost_of(boxes, ploc(1)));
}

}  // namespace
}  // namespace umbel::bvh
