// Boxes on a node's grid: none becomes smaller, none grows by more than a cell.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "base/math.hpp"
#include "bvh/wide/grid_node.hpp"

namespace umbel {
namespace {

using Boxes = std::array<Aabb, 8>;
constexpr Aabb kNowhere{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};

std::vector<uint32_t> node_of(const Boxes& boxes, uint32_t width) {
  std::vector<uint32_t> node(grid::node_words(width));
  grid::set_boxes(node.data(), width, boxes.data());
  return node;
}

float number(const std::vector<uint32_t>& node, uint32_t word) {
  return std::bit_cast<float>(node[word]);
}

/// Six numbers in the order of the rows.
std::array<float, 6> planes(const Aabb& b) {
  return {b.min.x, b.max.x, b.min.y, b.max.y, b.min.z, b.max.z};
}

void expect_held(const Boxes& boxes, uint32_t width) {
  const std::vector<uint32_t> node = node_of(boxes, width);
  ASSERT_TRUE(grid::is_grid(node.data()));
  for (uint32_t slot = 0; slot < width; ++slot) {
    if (is_empty(boxes[slot])) continue;
    const auto is = planes(boxes[slot]), becomes = planes(grid::box(node.data(), width, slot));
    for (uint32_t row = 0; row < 6; ++row) {
      const bool is_low = row % 2 == 0;
      const float cell = number(node, 3 + row / 2);
      // What shapes are compared with, and what rays see, which round to the nearest.
      if (is_low)
        ASSERT_LE(becomes[row], is[row]);
      else
        ASSERT_GE(becomes[row], is[row]);
      const double plane =
          number(node, row / 2) + double{cell} * grid::plane_of(node.data(), width, row, slot);
      const double rounding = std::ldexp(std::abs(double{is[row]}), -24);
      const double outwards = is_low ? is[row] - plane : plane - is[row];
      ASSERT_GE(outwards, -rounding) << "slot " << slot << ", row " << row;
      ASSERT_LE(outwards, 1.0001 * cell + 2 * rounding) << "slot " << slot << ", row " << row;
    }
  }
}

Boxes random_boxes(std::mt19937& random, float scale, float offset) {
  std::uniform_real_distribution<float> unit(-1, 1);
  Boxes boxes;
  for (Aabb& box : boxes) {
    if (random() % 5 == 0) {
      box = kNowhere;
      continue;
    }
    box = Aabb{};
    for (int corner = 0; corner < 2; ++corner)
      extend(box, Vec3{unit(random) * scale + offset, unit(random) * scale - offset,
                       unit(random) * scale * 1e-3f + offset});
  }
  boxes[0] = {{offset, -offset, offset}, {offset, -offset, offset}};
  return boxes;
}

TEST(GridNode, boxes_are_held_by_little_more_at_any_scale_and_place) {
  std::mt19937 random(1);
  for (const float scale : {1e-30f, 1e-15f, 1e-3f, 1.0f, 1e7f, 1e15f, 1e30f})
    for (const float distance : {0.0f, 1.0f, 1e3f, 1e6f, 1e8f})
      for (const uint32_t width : {2u, 4u, 8u})
        for (int run = 0; run < 20; ++run)
          expect_held(random_boxes(random, scale, scale * distance), width);
}

TEST(GridNode, a_box_without_extent_at_the_nodes_side_keeps_none) {
  Boxes boxes;
  boxes.fill(kNowhere);
  boxes[0] = {{-1, 0.3f, -1}, {1, 0.3f, 1}};  // a floor
  boxes[1] = {{-1, 0.3f, 0}, {0.1f, 0.7f, 0.2f}};
  const std::vector<uint32_t> node = node_of(boxes, 8);
  EXPECT_EQ(grid::box(node.data(), 8, 0).min.y, 0.3f);
  EXPECT_EQ(grid::box(node.data(), 8, 0).max.y, 0.3f);
}

TEST(GridNode, cells_are_no_larger_than_they_must_be) {
  Boxes boxes;
  boxes.fill(kNowhere);
  boxes[3] = {{0, 1, 100}, {65535, 1 + 0x1p-3f, 100}};
  const std::vector<uint32_t> node = node_of(boxes, 4);
  EXPECT_EQ(number(node, 3), 1.0f);
  EXPECT_EQ(number(node, 4), 0x1p-18f);  // 2^-19 leaves the last plane short by a cell
  EXPECT_EQ(number(node, 5), 0x1p-100f);
}

TEST(GridNode, the_largest_numbers_stay_finite) {
  constexpr float kMost = std::numeric_limits<float>::max();
  Boxes boxes;
  boxes.fill(kNowhere);
  boxes[0] = {{-kMost, -kMost, 0}, {kMost, 0, kMost}};
  const std::vector<uint32_t> node = node_of(boxes, 2);
  const Aabb box = grid::box(node.data(), 2, 0);
  EXPECT_EQ(box.min, (Vec3{-kMost, -kMost, 0}));
  EXPECT_EQ(box.max.x, kMost);
  EXPECT_GE(box.max.y, 0);
  EXPECT_EQ(box.max.z, kMost);
  EXPECT_TRUE(grid::is_grid(node.data()));
}

TEST(GridNode, what_no_grid_is_is_told_apart) {
  std::mt19937 random(2);
  const std::vector<uint32_t> sound = node_of(random_boxes(random, 1, 1), 8);
  ASSERT_TRUE(grid::is_grid(sound.data()));
  for (uint32_t axis = 0; axis < 3; ++axis) {
    for (const float origin : {kInfinity, -kInfinity, std::nanf("")}) {
      std::vector<uint32_t> node = sound;
      node[axis] = std::bit_cast<uint32_t>(origin);
      EXPECT_FALSE(grid::is_grid(node.data())) << origin;
    }
    for (const float cell : {0.0f, -1.0f, 0x1p-101f, 0.75f, kInfinity, std::nanf("")}) {
      std::vector<uint32_t> node = sound;
      node[3 + axis] = std::bit_cast<uint32_t>(cell);
      EXPECT_FALSE(grid::is_grid(node.data())) << cell;
    }
  }
}

}  // namespace
}  // namespace umbel
