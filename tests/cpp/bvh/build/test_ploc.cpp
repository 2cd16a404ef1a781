#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "bvh/build/config_of.hpp"
#include "bvh/build/ploc.hpp"
#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config ploc(uint32_t radius) {
  Config config = config_of(Builder::kPloc, &Config::ploc_radius, radius);
  config.ploc_sweep = 0;
  return config;
}

double cost_of(const std::vector<Aabb>& boxes, const Config& config) {
  return sah_cost(build(boxes, config), config.cost);
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
  // Each is nearest to the one before, so none but the first two finds a partner.
  std::vector<Aabb> boxes;
  for (int i = 0; i < 200000; ++i) {
    const float size = 1 + float(i) * 1e-3f;
    boxes.push_back({{-size, -size, -size}, {size, size, size}});
  }
  const Bvh2 tree = build(boxes, ploc(16));
  EXPECT_NO_THROW(check(tree, 200000));
}

TEST(Ploc, sah_built_top_levels_are_taken_where_they_are_cheaper) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  Config with_top = ploc(16), sweep;
  with_top.ploc_sweep = 8;
  sweep.builder = Builder::kSweep;
  EXPECT_LT(cost_of(boxes, with_top), 0.97 * cost_of(boxes, ploc(16)));
  EXPECT_LT(cost_of(boxes, with_top), 1.05 * cost_of(boxes, sweep));
  for (uint32_t seed = 0; seed < 8; ++seed) {
    const std::vector<Aabb> random = random_boxes(2000, seed, 0.5f);
    EXPECT_LE(cost_of(random, with_top), cost_of(random, ploc(16)) * 1.0001);
  }
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
