#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "base/morton.hpp"

namespace umbel {
namespace {

template <typename Key>
Key interleaved(uint32_t x, uint32_t y, uint32_t z, uint32_t bits) {
  Key code = 0;
  for (uint32_t b = bits; b-- > 0;)
    code = code << 3 | Key(x >> b & 1) << 2 | Key(y >> b & 1) << 1 | Key(z >> b & 1);
  return code;
}

std::vector<Aabb> random_boxes(uint32_t count) {
  std::mt19937 random(7);
  const auto next = [&] { return float(random() >> 8) * 0x1p-24f; };
  std::vector<Aabb> boxes(count);
  for (Aabb& box : boxes) {
    box.min = {10 * next(), next() - 3, next()};
    box.max = {box.min.x + next(), box.min.y + next(), box.min.z};
  }
  return boxes;
}

TEST(Morton, spreads_every_bit_to_every_third) {
  for (uint32_t bit = 0; bit < 10; ++bit)
    EXPECT_EQ(spread_bits(uint32_t{1} << bit), uint32_t{1} << 3 * bit);
  for (uint64_t bit = 0; bit < 21; ++bit)
    EXPECT_EQ(spread_bits(uint64_t{1} << bit), uint64_t{1} << 3 * bit);
  EXPECT_EQ(spread_bits(uint32_t{1023}), 0x09249249u);
  EXPECT_EQ(spread_bits(uint64_t{(1u << 21) - 1}), 0x1249249249249249u);
}

template <typename Key>
void expect_interleaved(uint32_t bits) {
  const std::vector<Aabb> boxes = random_boxes(500);
  const MortonGrid grid = MortonGrid::around({{0, -7, 0}, {22, -3, 2}}, bits);
  for (const Aabb& box : boxes) {
    const Vec3 center = box.min + box.max;
    const uint32_t x = grid.cell(center.x, 0), y = grid.cell(center.y, -7),
                   z = grid.cell(center.z, 0);
    EXPECT_LT(std::max({x, y, z}), 1u << bits);
    EXPECT_EQ(grid.template code<Key>(box), interleaved<Key>(x, y, z, bits));
  }
}

TEST(Morton, codes_interleave_the_cells_of_the_centre_x_highest) {
  expect_interleaved<uint32_t>(10);
  expect_interleaved<uint64_t>(20);
  expect_interleaved<uint64_t>(21);
}

TEST(Morton, cells_are_cubes_and_the_highest_centre_is_in_the_last) {
  const MortonGrid grid = MortonGrid::around({{0, 0, 0}, {8, 4, 2}}, 3);
  EXPECT_EQ(grid.cell(0, 0), 0u);
  EXPECT_EQ(grid.cell(0.99f, 0), 0u);
  EXPECT_EQ(grid.cell(1, 0), 1u);
  EXPECT_EQ(grid.cell(8, 0), 7u);
  EXPECT_EQ(grid.cell(4, 0), 4u);  // the end of the shorter y axis
}

template <typename Key>
void expect_sorted(uint32_t bits) {
  std::vector<Aabb> boxes = random_boxes(3000);
  boxes.insert(boxes.end(), boxes.begin(), boxes.begin() + 1000);
  CpuExec exec;
  const auto order = morton_order<Key>(exec, boxes.data(), boxes.size(), bits);
  Aabb centers;
  for (const Aabb& box : boxes) extend(centers, box.min + box.max);
  const MortonGrid grid = MortonGrid::around(centers, bits);
  std::vector<uint8_t> seen(boxes.size());
  for (size_t i = 0; i < boxes.size(); ++i) {
    const uint32_t primitive = order.primitives[i];
    ASSERT_LT(primitive, boxes.size());
    EXPECT_EQ(seen[primitive]++, 0);
    EXPECT_EQ(order.codes[i], grid.template code<Key>(boxes[primitive]));
    if (i == 0) continue;
    ASSERT_LE(order.codes[i - 1], order.codes[i]);
    if (order.codes[i - 1] == order.codes[i]) ASSERT_LT(order.primitives[i - 1], primitive);
  }
}

TEST(Morton, order_is_that_of_codes_and_then_of_primitives) {
  expect_sorted<uint32_t>(10);
  expect_sorted<uint64_t>(21);
}

TEST(Morton, boxes_with_one_centre_keep_their_order) {
  const std::vector<Aabb> boxes(100, Aabb{{1, 2, 3}, {4, 5, 6}});
  CpuExec exec;
  const auto order = morton_order<uint64_t>(exec, boxes.data(), boxes.size(), 21);
  for (uint32_t i = 0; i < boxes.size(); ++i) {
    EXPECT_EQ(order.primitives[i], i);
    EXPECT_EQ(order.codes[i], 0u);
  }
}

}  // namespace
}  // namespace umbel
