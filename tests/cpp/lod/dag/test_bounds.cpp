#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "lod/dag/bounds.hpp"

namespace umbel::lod {
namespace {

double distance(const Vec3& a, const Vec3& b) {
  return std::hypot(double{a.x} - b.x, double{a.y} - b.y, double{a.z} - b.z);
}

TEST(Bounds, sphere_contains_its_points_at_any_scale) {
  std::mt19937 random(1);
  for (float scale : {1e-18f, 1e-3f, 1.0f, 1e6f, 1e15f}) {
    std::uniform_real_distribution<float> coordinate(-scale, scale);
    for (int trial = 0; trial < 200; ++trial) {
      std::vector<Vec3> points(1 + random() % 40);
      for (Vec3& p : points) p = {coordinate(random), coordinate(random), coordinate(random)};
      const Sphere s = bounding_sphere(points);
      for (const Vec3& p : points) EXPECT_LE(distance(s.center, p), s.radius);
      EXPECT_LE(s.radius, 1.75 * scale);
    }
  }
}

TEST(Bounds, sphere_of_one_point_is_that_point) {
  const Vec3 p{1, 2, 3};
  EXPECT_EQ(bounding_sphere({&p, 1}), (Sphere{p, 0.0f}));
}

TEST(Bounds, sphere_is_near_the_smallest) {
  // Smallest sphere of a cube's corners: radius sqrt(3).
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i)
    corners.push_back({i & 1 ? 1.f : -1.f, i & 2 ? 1.f : -1.f, i & 4 ? 1.f : -1.f});
  EXPECT_LT(bounding_sphere(corners).radius, 1.15 * std::sqrt(3.0));
}

TEST(Bounds, enclosing_sphere_contains_spheres_with_its_margin) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> coordinate(-10, 10), radius(0, 3);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Sphere> spheres(1 + random() % 20);
    for (Sphere& s : spheres)
      s = {{coordinate(random), coordinate(random), coordinate(random)}, radius(random)};
    const Sphere all = enclosing_sphere(spheres);
    for (const Sphere& s : spheres)
      EXPECT_LE((distance(all.center, s.center) + s.radius) * (1 + 0.99 * kSphereMargin),
                all.radius);
  }
}

}  // namespace
}  // namespace umbel::lod
