#include <gtest/gtest.h>

#include "bvh/every_config.hpp"
#include "bvh/oracle.hpp"

namespace umbel {
namespace {

using namespace testing;

std::vector<Bvh> trees_of(const Mesh& mesh) {
  std::vector<Bvh> trees;
  for (const BvhConfig& config : every_config()) trees.push_back(Bvh::build(mesh.view(), config));
  return trees;
}

template <typename Touches>
std::vector<uint32_t> brute_force(const Mesh& mesh, const Touches& touches) {
  std::vector<uint32_t> found;
  for (uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    if (touches(mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]))
      found.push_back(i);
  }
  return found;
}

TEST(BvhOverlap, boxes_and_spheres_equal_brute_force) {
  for (const Mesh& mesh : {shapes::blob(2, 1), shapes::soup(200, 2), shapes::grid(9, 9)}) {
    const std::vector<Bvh> trees = trees_of(mesh);
    std::mt19937 random(3);
    std::uniform_real_distribution<float> unit(-1, 1);
    size_t touched = 0;
    for (int i = 0; i < 60; ++i) {
      const Vec3 p{unit(random), unit(random), unit(random)};
      const float r = std::abs(unit(random)) / (i % 2 ? 2 : 20);
      const Aabb box{{p.x - r, p.y - r / 2, p.z - r}, {p.x + r, p.y + r / 2, p.z + 2 * r}};
      const Sphere sphere{p, r};
      const auto in_box = brute_force(mesh, [&](const Vec3& a, const Vec3& b, const Vec3& c) {
        return touches_box(box, a, b, c);
      });
      const auto in_sphere = brute_force(mesh, [&](const Vec3& a, const Vec3& b, const Vec3& c) {
        return touches_sphere(sphere, a, b, c);
      });
      touched += in_box.size() + in_sphere.size();
      for (const Bvh& tree : trees) {
        ASSERT_EQ(tree.overlaps(box), in_box);
        ASSERT_EQ(tree.overlaps(sphere), in_sphere);
      }
    }
    EXPECT_GT(touched, 100u);
  }
}

/// Looking along x from the origin, a quarter turn wide, from 0.5 to 1.
Frustum frustum() {
  return {Plane{{1, 0, 0}, -0.5f}, Plane{{-1, 0, 0}, 1}, Plane{{1, 1, 0}, 0},
          Plane{{1, -1, 0}, 0},    Plane{{1, 0, 1}, 0},  Plane{{1, 0, -1}, 0}};
}

TEST(BvhOverlap, a_frustum_has_all_that_has_a_corner_in_it_and_nothing_beyond_one_plane) {
  const Mesh mesh = shapes::soup(500, 4);
  const auto height = [](const Plane& plane, const Vec3& p) {
    return double(plane.normal.x) * p.x + double(plane.normal.y) * p.y +
           double(plane.normal.z) * p.z + plane.offset;
  };
  const Frustum region = frustum();
  const auto certain = brute_force(mesh, [&](const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto inside = [&](const Vec3& p) {
      for (const Plane& plane : region)
        if (height(plane, p) < 0) return false;
      return true;
    };
    return inside(a) || inside(b) || inside(c);
  });
  const auto possible = brute_force(mesh, [&](const Vec3& a, const Vec3& b, const Vec3& c) {
    for (const Plane& plane : region)
      if (height(plane, a) < 0 && height(plane, b) < 0 && height(plane, c) < 0) return false;
    return true;
  });
  EXPECT_GT(certain.size(), 5u);
  for (const Bvh& tree : trees_of(mesh)) {
    const std::vector<uint32_t> found = tree.overlaps(region);
    ASSERT_TRUE(std::includes(found.begin(), found.end(), certain.begin(), certain.end()));
    ASSERT_TRUE(std::includes(possible.begin(), possible.end(), found.begin(), found.end()));
  }
}

TEST(BvhOverlap, regions_that_are_none_touch_nothing) {
  const Bvh tree = Bvh::build(shapes::sphere(2).view());
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(tree.overlaps(Aabb{}).empty());
  EXPECT_TRUE(tree.overlaps(Aabb{{1, 1, 1}, {-1, -1, -1}}).empty());
  EXPECT_TRUE(tree.overlaps(Aabb{{kNan, -1, -1}, {1, 1, 1}}).empty());
  EXPECT_TRUE(tree.overlaps(Sphere{{0, 0, 0}, -2}).empty());
  EXPECT_TRUE(tree.overlaps(Sphere{{0, 0, 0}, kNan}).empty());
  EXPECT_TRUE(tree.overlaps(Sphere{{kNan, 0, 0}, 2}).empty());
  EXPECT_EQ(tree.overlaps(Sphere{{0, 0, 0}, 2}).size(), 320u);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(tree.overlaps(Sphere{{0, 0, 0}, kInfinity}).size(), 320u);
  EXPECT_EQ(tree.overlaps(Aabb{{-9, -9, -9}, {9, 9, 9}}).size(), 320u);
}

TEST(BvhOverlap, boxes_with_infinite_sides_are_those_with_the_largest_floats) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kMost = std::numeric_limits<float>::max();
  const Mesh mesh = shapes::sphere(2);
  const auto half = brute_force(mesh, [](const Vec3& a, const Vec3& b, const Vec3& c) {
    return std::max({a.x, b.x, c.x}) >= 0.25f;
  });
  const auto column = brute_force(mesh, [](const Vec3& a, const Vec3& b, const Vec3& c) {
    return touches_box({{-0.5f, -0.5f, -kMost}, {0.5f, 0.5f, 0.1f}}, a, b, c);
  });
  EXPECT_GT(column.size(), 10u);
  for (const Bvh& tree : trees_of(mesh)) {
    const Vec3 everywhere{kInfinity, kInfinity, kInfinity};
    EXPECT_EQ(tree.overlaps(Aabb{everywhere * -1, everywhere}).size(), mesh.triangles.size());
    EXPECT_EQ(tree.overlaps(Aabb{{0.25f, -kInfinity, -kInfinity}, everywhere}), half);
    EXPECT_EQ(tree.overlaps(Aabb{{-0.5f, -0.5f, -kInfinity}, {0.5f, 0.5f, 0.1f}}), column);
    EXPECT_TRUE(tree.overlaps(Aabb{everywhere, everywhere}).empty());
  }
}

TEST(BvhOverlap, a_box_touches_a_triangle_exactly_where_they_share_a_point) {
  const Vec3 a{0, 0, 0}, b{4, 0, 0}, c{0, 4, 0};
  EXPECT_TRUE(touches_box({{2, 2, 0}, {3, 3, 1}}, a, b, c));  // the edge's middle alone
  EXPECT_FALSE(touches_box({{std::nextafter(2.0f, 3.0f), 2, 0}, {3, 3, 1}}, a, b, c));
  EXPECT_TRUE(touches_box({{-1, -1, -1}, {0, 0, 0}}, a, b, c));
  EXPECT_TRUE(touches_box({{1, 1, -1}, {1.5f, 1.5f, 0}}, a, b, c));
  EXPECT_FALSE(touches_box({{1, 1, 1e-30f}, {1.5f, 1.5f, 1}}, a, b, c));
  EXPECT_TRUE(touches_box({{1, 1, 0}, {1, 1, 0}}, a, b, c));   // a point is a box
  EXPECT_TRUE(touches_box({{1, -1, 0}, {2, 1, 0}}, a, b, b));  // a segment is a triangle
  EXPECT_FALSE(touches_box({{1, 1, 0}, {2, 2, 0}}, a, b, b));
  EXPECT_TRUE(touches_box({{-1, -1, -1}, {1, 1, 1}}, a, a, a));
}

TEST(BvhOverlap, the_box_test_agrees_with_the_distance_between_box_and_triangle) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(-1, 1);
  size_t hits = 0, misses = 0;
  for (int run = 0; run < 4000; ++run) {
    const float scale = run % 3 == 0 ? 1e-30f : run % 3 == 1 ? 1.0f : 1e30f;
    const auto any = [&](float reach) {
      return Vec3{unit(random) * reach * scale, unit(random) * reach * scale,
                  unit(random) * reach * scale};
    };
    const Vec3 p0 = any(1.5f), p1 = any(1.5f), p2 = any(1.5f);
    const Vec3 q = any(1), r = any(1);
    const Aabb box{{std::min(q.x, r.x), std::min(q.y, r.y), std::min(q.z, r.z)},
                   {std::max(q.x, r.x), std::max(q.y, r.y), std::max(q.z, r.z)}};
    // Projections between two convex sets, back and forth, find the distance.
    Vec3d on{q.x, q.y, q.z};
    double distance = 0;
    for (int i = 0; i < 400; ++i) {
      const Vec3d a = to_double(p0) - on, b = to_double(p1) - on, c = to_double(p2) - on;
      const TrianglePoint t = closest_on_triangle(a, b, c);
      const Vec3d nearest = to_double(p0) + (to_double(p1) - to_double(p0)) * t.u +
                            (to_double(p2) - to_double(p0)) * t.v;
      on = {std::clamp<double>(nearest.x, box.min.x, box.max.x),
            std::clamp<double>(nearest.y, box.min.y, box.max.y),
            std::clamp<double>(nearest.z, box.min.z, box.max.z)};
      distance = length(nearest - on) / scale;
    }
    const bool touches = touches_box(box, p0, p1, p2);
    if (distance == 0) ASSERT_TRUE(touches) << run;
    if (distance > 0.02) ASSERT_FALSE(touches) << run;
    (touches ? hits : misses) += 1;
  }
  EXPECT_GT(hits, 400u);
  EXPECT_GT(misses, 400u);
}

}  // namespace
}  // namespace umbel
