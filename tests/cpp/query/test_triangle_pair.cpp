#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "query/triangle_pair.hpp"

namespace umbel {
namespace {

using Corners = std::array<Vec3, 3>;

struct Vec3i {
  int64_t x, y, z;
};
Vec3i to_integers(const Vec3& p) { return {int64_t(p.x), int64_t(p.y), int64_t(p.z)}; }
Vec3i minus(const Vec3i& a, const Vec3i& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec3i cross(const Vec3i& a, const Vec3i& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// In whole numbers, by separating axes, of which these are all that two triangles, segments or
/// points may need.
bool meet_by_axes(const Corners& first, const Corners& second) {
  std::vector<Vec3i> p, q, edges, axes;
  for (const Vec3& corner : first) p.push_back(to_integers(corner));
  for (const Vec3& corner : second) q.push_back(to_integers(corner));
  for (int i = 0; i < 3; ++i) {
    edges.push_back(minus(p[(i + 1) % 3], p[i]));
    edges.push_back(minus(q[(i + 1) % 3], q[i]));
  }
  const Vec3i between = minus(p[0], q[0]);
  axes.push_back(between);
  for (const Vec3i& d : edges) {
    axes.push_back(d);
    axes.push_back(cross(d, cross(d, between)));
    for (const Vec3i& e : edges) {
      axes.push_back(cross(d, e));
      for (const Vec3i& f : edges) axes.push_back(cross(cross(d, e), f));
    }
  }
  return std::none_of(axes.begin(), axes.end(), [&](const Vec3i& axis) {
    const auto on = [&](const Vec3i& v) { return axis.x * v.x + axis.y * v.y + axis.z * v.z; };
    const auto [p_low, p_high] = std::minmax({on(p[0]), on(p[1]), on(p[2])});
    const auto [q_low, q_high] = std::minmax({on(q[0]), on(q[1]), on(q[2])});
    return p_high < q_low || q_high < p_low;
  });
}

TEST(TrianglePair, is_decided_as_in_whole_numbers) {
  std::mt19937 random(1);
  size_t found = 0;
  for (const int range : {1, 2, 3, 6, 40}) {
    std::uniform_int_distribution<int> number(-range, range);
    for (int i = 0; i < 20000; ++i) {
      Corners triangles[2];
      for (Corners& triangle : triangles)
        for (Vec3& p : triangle)
          // A third of the cases in one plane.
          p = {float(number(random)), float(number(random)), i % 3 ? float(number(random)) : 0};
      const bool truth = meet_by_axes(triangles[0], triangles[1]);
      ASSERT_EQ(triangles_meet(triangles[0], triangles[1]), truth) << range << ", " << i;
      ASSERT_EQ(triangles_meet(triangles[1], triangles[0]), truth) << range << ", " << i;
      found += truth;
    }
  }
  EXPECT_GT(found, 10000u);
  EXPECT_LT(found, 90000u);
}

TEST(TrianglePair, touching_counts_and_a_gap_of_one_unit_in_the_last_place_does_not) {
  const Corners floor{Vec3{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  const auto above = [](float z) { return Corners{Vec3{1, 1, z}, {2, 1, 3}, {1, 2, 3}}; };
  EXPECT_TRUE(triangles_meet(floor, above(0)));
  EXPECT_FALSE(triangles_meet(floor, above(std::nextafter(0.0f, 1.0f))));
  EXPECT_TRUE(triangles_meet(floor, above(std::nextafter(0.0f, -1.0f))));
  // Along an edge, at a corner, the same triangle, one within the other in one plane.
  EXPECT_TRUE(triangles_meet(floor, {Vec3{0, 0, 0}, {4, 0, 0}, {0, 0, 4}}));
  EXPECT_TRUE(triangles_meet(floor, {Vec3{4, 0, 0}, {8, 0, 0}, {8, 1, 1}}));
  EXPECT_TRUE(triangles_meet(floor, floor));
  EXPECT_TRUE(triangles_meet(floor, {Vec3{1, 1, 0}, {1.5f, 1, 0}, {1, 1.5f, 0}}));
  EXPECT_FALSE(triangles_meet(floor, {Vec3{3, 3, 0}, {4, 3, 0}, {3, 4, 0}}));
}

/// Where rounding in double decides nothing any more.
TEST(TrianglePair, holds_far_from_the_origin) {
  const float far = 1e7f;
  const auto moved = [&](Corners t) {
    for (Vec3& p : t) p = {p.x + far, p.y + far, p.z + far};
    return t;
  };
  std::mt19937 random(2);
  std::uniform_int_distribution<int> number(-4, 4);
  for (int i = 0; i < 5000; ++i) {
    Corners a, b;
    for (Vec3& p : a) p = {float(number(random)), float(number(random)), float(number(random))};
    for (Vec3& p : b) p = {float(number(random)), float(number(random)), float(number(random))};
    // Whole numbers below 2^24 are exact.
    ASSERT_EQ(triangles_meet(moved(a), moved(b)), meet_by_axes(a, b));
  }
}

}  // namespace
}  // namespace umbel
