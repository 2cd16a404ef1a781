#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "umbel/mesh.hpp"

namespace umbel {
namespace {

/// A grid of so many squares a side, each `cell` wide, around a point.
struct Patch {
  std::vector<Vec3d> world;
  std::vector<Triangle> triangles;
};

Patch patch(uint32_t side, double cell, Vec3d at) {
  Patch made;
  for (uint32_t y = 0; y <= side; ++y)
    for (uint32_t x = 0; x <= side; ++x)
      made.world.push_back({at.x + cell * x, at.y + cell * y, at.z});
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x) {
      const uint32_t a = y * (side + 1) + x, b = a + side + 1;
      made.triangles.push_back({a, a + 1, b});
      made.triangles.push_back({a + 1, b + 1, b});
    }
  return made;
}

std::vector<Vec3> rounded(const std::vector<Vec3d>& world, Vec3d origin) {
  std::vector<Vec3> positions;
  for (const Vec3d& p : world) positions.push_back(relative_to(origin, p));
  return positions;
}

TEST(RoundingLoss, of_a_map_is_large_without_an_origin_and_small_with_one) {
  constexpr Vec3d kUtm{500000, 4649776, 0};
  const Patch utm = patch(99, 0.05, kUtm);
  const RoundingLoss lost = rounding_loss(utm.world, {}, rounded(utm.world, {}), utm.triangles);
  EXPECT_GT(lost.largest_move, 0.2);
  EXPECT_LE(lost.largest_move, std::hypot(0.25, 0.015625) + 1e-9);
  EXPECT_GT(lost.degenerate, utm.triangles.size() / 2);
  const RoundingLoss kept = rounding_loss(utm.world, kUtm, rounded(utm.world, kUtm), utm.triangles);
  EXPECT_LT(kept.largest_move, 1e-6);
  EXPECT_EQ(kept.degenerate, 0u);
}

TEST(RoundingLoss, counts_only_triangles_that_had_an_area) {
  const std::vector<Vec3d> world{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0.3, 0, 0}, {0.7, 1e-5, 0}};
  std::vector<Vec3> flat = rounded(world, {});
  for (Vec3& p : flat) p.y = 0;
  const std::vector<Triangle> triangles{{0, 1, 2}, {0, 0, 1}, {0, 3, 2}, {0, 1, 4}};
  EXPECT_EQ(rounding_loss(world, {}, flat, triangles).degenerate, 1u);
}

TEST(RoundingLoss, leaves_out_what_is_not_finite_or_not_there) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Vec3d> world{{0, 0, 0}, {nan, 0, 0}, {1e300, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 3}, {0, 2, 4}, {0, 3, 9}, {0, 3, 4}};
  std::vector<Vec3> positions = rounded(world, {});
  EXPECT_EQ(rounding_loss(world, {}, positions, triangles).largest_move, 0);
  positions[4].y = 1.5f;
  EXPECT_EQ(rounding_loss(world, {}, positions, triangles).largest_move, 0.5);
  positions.pop_back();
  EXPECT_THROW(rounding_loss(world, {}, positions, triangles), Error);
}

}  // namespace
}  // namespace umbel
