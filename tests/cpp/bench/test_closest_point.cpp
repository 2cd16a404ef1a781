#include <gtest/gtest.h>

#include "../../../bench/closest_point.hpp"

namespace bench {
namespace {

TEST(ClosestPoint, distances_equal_brute_force) {
  for (const Mesh& mesh : {umbel::shapes::blob(3, 1), umbel::shapes::soup(300, 2),
                           umbel::shapes::grid(9, 7), umbel::shapes::fan(50)}) {
    const ClosestPoint closest(mesh);
    std::mt19937 random(3);
    std::uniform_real_distribution<float> between(-2, 2);
    for (int i = 0; i < 500; ++i) {
      const Vec3 p{between(random), between(random), between(random)};
      double best = std::numeric_limits<double>::infinity();
      for (const umbel::Triangle& t : mesh.triangles)
        best = std::min(
            best, triangle_distance2(point(p), point(mesh.positions[t[0]]),
                                     point(mesh.positions[t[1]]), point(mesh.positions[t[2]])));
      EXPECT_DOUBLE_EQ(closest.distance(p), std::sqrt(best));
    }
  }
}

TEST(ClosestPoint, triangle_distance_is_that_of_a_fine_grid_of_its_points) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> between(-1, 1);
  const auto any = [&] { return Point{between(random), between(random), between(random)}; };
  for (int i = 0; i < 100; ++i) {
    const Point a = any(), b = any(), c = any(), p = any() * 2;
    double best = std::numeric_limits<double>::infinity();
    constexpr int kSteps = 200;
    for (int u = 0; u <= kSteps; ++u)
      for (int v = 0; u + v <= kSteps; ++v) {
        const Point d = a + (b - a) * (double(u) / kSteps) + (c - a) * (double(v) / kSteps) - p;
        best = std::min(best, dot(d, d));
      }
    const double exact = std::sqrt(triangle_distance2(p, a, b, c));
    EXPECT_LE(exact, std::sqrt(best) + 1e-12);
    EXPECT_GE(exact, std::sqrt(best) - 0.02);
  }
}

TEST(ClosestPoint, samples_lie_on_the_surface_and_are_uniform) {
  const Mesh mesh = umbel::shapes::grid(5, 3);  // the unit square
  const std::vector<Vec3> samples = sample_surface(mesh, 40000, 1);
  size_t left = 0, low = 0;
  for (const Vec3& p : samples) {
    EXPECT_EQ(p.z, 0);
    left += p.x < 0.25f;
    low += p.y < 0.75f;
  }
  EXPECT_NEAR(left / 40000.0, 0.25, 0.01);
  EXPECT_NEAR(low / 40000.0, 0.75, 0.01);
}

TEST(ClosestPoint, parallel_planes_are_as_far_apart_as_they_are) {
  const Mesh low = umbel::shapes::grid(8, 8);
  Mesh high = umbel::shapes::grid(3, 3);
  for (Vec3& p : high.positions) p.z = 0.125f;
  const Deviation d = two_sided_deviation(low, ClosestPoint(low), high, 2000);
  EXPECT_NEAR(d.mean, 0.125, 1e-7);
  EXPECT_NEAR(d.rms, 0.125, 1e-7);
  EXPECT_NEAR(d.max, 0.125, 1e-7);
}

}  // namespace
}  // namespace bench
