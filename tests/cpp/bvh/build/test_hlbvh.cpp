#include <gtest/gtest.h>

#include "base/morton.hpp"
#include "bvh/build/config_of.hpp"
#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config hlbvh(uint32_t bits) { return config_of(Builder::kHlbvh, &Config::hlbvh_bits, bits); }

double cost_of(const std::vector<Aabb>& boxes, Config config) {
  return sah_cost(build(boxes, config), config.cost);
}

TEST(Hlbvh, subtrees_of_one_prefix_are_kept_together) {
  // Below the tree of treelets, leading bits agree; and a treelet lies below one node.
  const auto boxes = random_boxes(50000, 3);
  Config config = hlbvh(9);
  config.max_leaf_size = 1;
  const Bvh2 tree = build(boxes, config);
  Aabb centers;
  for (const Aabb& box : boxes) extend(centers, box.min + box.max);
  const MortonGrid grid = MortonGrid::around(centers, 20);
  std::vector<uint64_t> prefixes;
  for (const uint32_t primitive : tree.primitives) {
    const uint64_t prefix = grid.code<uint64_t>(boxes[primitive]) >> 51;
    if (prefixes.empty() || prefixes.back() != prefix) prefixes.push_back(prefix);
  }
  ASSERT_EQ(prefixes.size(), 512u);
  std::sort(prefixes.begin(), prefixes.end());
  for (uint64_t i = 0; i < 512; ++i) EXPECT_EQ(prefixes[i], i);
}

TEST(Hlbvh, more_leading_bits_make_better_trees) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  Config linear;
  linear.builder = Builder::kLbvh;
  EXPECT_LT(cost_of(boxes, hlbvh(15)), cost_of(boxes, linear));
  EXPECT_LT(cost_of(boxes, hlbvh(30)), cost_of(boxes, hlbvh(9)));
}

TEST(Hlbvh, with_all_bits_for_the_sweep_is_near_the_sweep) {
  const auto boxes = random_boxes(5000, 2);
  Config sweep;
  sweep.builder = Builder::kSweep;
  EXPECT_LT(cost_of(boxes, hlbvh(30)), 1.02 * cost_of(boxes, sweep));
}

}  // namespace
}  // namespace umbel::bvh
