#include <gtest/gtest.h>

#include "base/morton.hpp"
#include "bvh/build/config_of.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config lbvh(uint32_t bits) { return config_of(Builder::kLbvh, &Config::morton_bits, bits); }

TEST(Lbvh, is_the_radix_tree_of_the_codes) {
  // With leaves of one, an inner node splits where the highest bit differs: codes below the left
  // child share one bit more with each other than with those below the right one.
  const auto boxes = random_boxes(50000, 3);
  Config config = lbvh(63);
  config.max_leaf_size = 1;
  const Bvh2 tree = build(boxes, config);
  ASSERT_EQ(tree.nodes.size(), 2 * boxes.size() - 1);
  Aabb centers;
  for (const Aabb& box : boxes) extend(centers, box.min + box.max);
  const MortonGrid grid = MortonGrid::around(centers, 21);
  struct Codes {
    uint64_t lowest, highest;
  };
  std::vector<Codes> codes(tree.nodes.size());
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    const Node& node = tree.nodes[i];
    if (node.is_leaf()) {
      const uint64_t code = grid.code<uint64_t>(boxes[tree.primitives[node.first]]);
      codes[i] = {code, code};
      continue;
    }
    const Codes left = codes[node.first], right = codes[node.first + 1];
    ASSERT_LE(left.highest, right.lowest);
    codes[i] = {left.lowest, right.highest};
    const uint64_t across = left.lowest ^ right.highest;
    if (across == 0) continue;
    ASSERT_LT(left.lowest ^ left.highest, std::bit_floor(across));
    ASSERT_LT(right.lowest ^ right.highest, std::bit_floor(across));
  }
}

TEST(Lbvh, large_trees_are_the_same_for_any_threads) {
  // Many parts, which threads build and write side by side.
  const auto boxes = random_boxes(200000, 7);
  for (const bool reinserted : {false, true}) {
    Config config = lbvh(63);
    config.builder = reinserted ? Builder::kLbvh : Builder::kHlbvh;
    config.reinsertion_rounds = reinserted;
    const Bvh2 tree = build(boxes, config, with_thread_count(1));
    check(tree, uint32_t(boxes.size()));
    expect_same(tree, build(boxes, config, with_thread_count(2)));
    expect_same(tree, build(boxes, config, with_thread_count(8)));
  }
  const Bvh2 plain = build(boxes, lbvh(63), with_thread_count(1));
  expect_same(plain, build(boxes, lbvh(63), with_thread_count(8)));
}

TEST(Lbvh, costs_more_than_the_sweep_but_not_absurdly) {
  const auto boxes = random_boxes(20000, 4);
  Config sweep;
  sweep.builder = Builder::kSweep;
  const double reference = sah_cost(build(boxes, sweep));
  const double linear = sah_cost(build(boxes, lbvh(63)));
  EXPECT_GT(linear, reference);
  EXPECT_LT(linear, 2 * reference);
}

TEST(Morton, codes_interleave_the_bits_of_the_cells) {
  std::mt19937 random(1);
  for (int k = 0; k < 1000; ++k) {
    const uint64_t x = random() >> 11, y = random() >> 11, z = random() >> 11;
    const uint64_t code = spread_bits(x) << 2 | spread_bits(y) << 1 | spread_bits(z);
    const uint32_t low = spread_bits(uint32_t(x & 1023)) << 2 |
                         spread_bits(uint32_t(y & 1023)) << 1 | spread_bits(uint32_t(z & 1023));
    for (uint32_t b = 0; b < 21; ++b) {
      ASSERT_EQ(code >> (3 * b) & 7, (x >> b & 1) << 2 | (y >> b & 1) << 1 | (z >> b & 1));
      if (b < 10) ASSERT_EQ(low >> (3 * b) & 7, code >> (3 * b) & 7);
    }
  }
}

}  // namespace
}  // namespace umbel::bvh
