#include <gtest/gtest.h>

#include <algorithm>
#include <ctime>
#include <tuple>

#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config with_builder(Builder builder) {
  Config config;
  config.builder = builder;
  return config;
}

double cost_of(const std::vector<Aabb>& boxes, Builder builder) {
  return sah_cost(build(boxes, with_builder(builder)));
}

Aabb united(const Aabb& a, const Aabb& b) {
  return {{std::min(a.min.x, b.min.x), std::min(a.min.y, b.min.y), std::min(a.min.z, b.min.z)},
          {std::max(a.max.x, b.max.x), std::max(a.max.y, b.max.y), std::max(a.max.z, b.max.z)}};
}

float area(const Aabb& b) {
  const float x = b.max.x - b.min.x, y = b.max.y - b.min.y, z = b.max.z - b.min.z;
  return x * y + z * (x + y);
}

bool is_before(const Aabb& a, const Aabb& b) {
  const auto key = [](const Aabb& v) {
    return std::tie(v.min.x, v.min.y, v.min.z, v.max.x, v.max.y, v.max.z);
  };
  return key(a) < key(b);
}

/// The boxes of all merges of the algorithm as it is written down: always the nearest two.
std::vector<Aabb> merged_one_by_one(std::vector<Aabb> clusters) {
  std::vector<Aabb> merges;
  while (clusters.size() > 1) {
    size_t a = 0, b = 1;
    for (size_t i = 0; i < clusters.size(); ++i)
      for (size_t j = i + 1; j < clusters.size(); ++j)
        if (area(united(clusters[i], clusters[j])) < area(united(clusters[a], clusters[b])))
          a = i, b = j;
    clusters[a] = united(clusters[a], clusters[b]);
    merges.push_back(clusters[a]);
    clusters.erase(clusters.begin() + std::ptrdiff_t(b));
  }
  std::sort(merges.begin(), merges.end(), is_before);
  return merges;
}

std::vector<Aabb> inner_boxes(const Bvh2& tree) {
  std::vector<Aabb> boxes;
  for (const Node& node : tree.nodes)
    if (!node.is_leaf()) boxes.push_back(node.box());
  std::sort(boxes.begin(), boxes.end(), is_before);
  return boxes;
}

TEST(Agglomerative, merges_are_those_of_the_one_by_one_algorithm) {
  Config config = with_builder(Builder::kAgglomerative);
  config.max_leaf_size = 1;
  config.max_depth = 255;
  for (const uint32_t count : {2u, 3u, 10u, 65u, 150u, 300u})
    for (const float size : {0.0f, 0.05f, 1.0f}) {
      const std::vector<Aabb> boxes = random_boxes(count, count, size);
      EXPECT_EQ(inner_boxes(build(boxes, config)), merged_one_by_one(boxes));
    }
}

/// All Morton codes but one are equal there.
TEST(Agglomerative, a_box_very_far_away_does_not_make_builds_take_the_square_of_the_number) {
  std::vector<Aabb> boxes = random_boxes(100000, 7);
  boxes.push_back({{1e9f, 0, 0}, {1e9f, 1, 1}});
  Config config = with_builder(Builder::kAgglomerative);
  config.max_leaf_size = 1;
  const std::clock_t began = std::clock();
  const Bvh2 tree = build(boxes, config);
  EXPECT_LT(double(std::clock() - began) / CLOCKS_PER_SEC, 20);
  EXPECT_EQ(tree.primitives.size(), boxes.size());
}

/// Each box within all later ones: the nearest two are always the innermost.
TEST(Agglomerative, boxes_within_boxes_merge_from_the_inside) {
  std::vector<Aabb> boxes;
  for (int i = 1; i <= 200; ++i) boxes.push_back({{-float(i), -1, -1}, {float(i), 1, 1}});
  std::reverse(boxes.begin() + 50, boxes.begin() + 150);
  Config config = with_builder(Builder::kAgglomerative);
  config.max_leaf_size = 1;
  config.max_depth = 255;
  EXPECT_EQ(statistics(build(boxes, config)).max_depth, 199u);
}

TEST(Agglomerative, identical_boxes_make_a_low_tree) {
  Config config = with_builder(Builder::kAgglomerative);
  config.max_leaf_size = 1;
  const std::vector<Aabb> boxes(1024, Aabb{{0, 0, 0}, {1, 1, 1}});
  EXPECT_LE(statistics(build(boxes, config)).max_depth, 80u);
}

/// One primitive range as a whole is agglomeration without approximation.
TEST(Aac, of_one_range_is_agglomeration) {
  Config config = with_builder(Builder::kAac);
  config.aac.leaf_size = 128;
  config.max_leaf_size = 1;
  const std::vector<Aabb> boxes = random_boxes(100, 4);
  EXPECT_EQ(inner_boxes(build(boxes, config)), merged_one_by_one(boxes));
}

class AgglomerativeScenes : public ::testing::TestWithParam<const char*> {};

TEST_P(AgglomerativeScenes, are_cheaper_than_linear_trees) {
  const auto mesh = umbel::testing::read_mesh(GetParam());
  if (!mesh) GTEST_SKIP() << "no " << GetParam();
  const std::vector<Aabb> boxes = triangle_boxes(mesh->view());
  const double linear = cost_of(boxes, Builder::kLbvh), sweep = cost_of(boxes, Builder::kSweep);
  for (const Builder builder : {Builder::kAgglomerative, Builder::kAac}) {
    EXPECT_LT(cost_of(boxes, builder), linear) << name(builder);
    EXPECT_LT(cost_of(boxes, builder), 1.2 * sweep) << name(builder);
  }
}

INSTANTIATE_TEST_SUITE_P(RealMeshes, AgglomerativeScenes,
                         ::testing::Values("bunny_69k.ply", "sibenik_75k.ply",
                                           "conference_331k.ply"));

}  // namespace
}  // namespace umbel::bvh
