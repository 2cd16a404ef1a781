#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "base/math.hpp"
#include "bvh/every_config.hpp"
#include "bvh/oracle.hpp"
#include "query/triangle_pair.hpp"
#include "umbel/collision.hpp"

namespace umbel {
namespace {

using namespace testing;

std::array<Vec3, 3> corners(const Mesh& mesh, uint32_t triangle) {
  const Triangle& t = mesh.triangles[triangle];
  return {mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
}

std::vector<TrianglePair> brute_force(const Mesh& first, const Mesh& second) {
  std::vector<TrianglePair> found;
  for (uint32_t i = 0; i < first.triangles.size(); ++i)
    for (uint32_t k = 0; k < second.triangles.size(); ++k)
      if (triangles_meet(corners(first, i), corners(second, k))) found.push_back({i, k});
  return found;
}

Mesh moved(Mesh mesh, const Vec3& by) {
  for (Vec3& p : mesh.positions) p = {p.x + by.x, p.y + by.y, p.z + by.z};
  return mesh;
}

TEST(Collide, pairs_are_those_of_brute_force) {
  const Mesh meshes[] = {shapes::blob(2, 1), shapes::soup(200, 2), shapes::grid(9, 9),
                         shapes::torus(16, 8)};
  size_t pairs = 0;
  for (const Mesh& first : meshes)
    for (const Mesh& given : meshes) {
      const Mesh second = moved(given, {0.25f, 0.125f, 0});
      const auto truth = brute_force(first, second);
      pairs += truth.size();
      for (const BvhConfig& config : every_config()) {
        const Bvh a = Bvh::build(first.view(), config), b = Bvh::build(second.view(), config);
        ASSERT_EQ(collide(a, b), truth);
        ASSERT_EQ(collides(a, b), !truth.empty());
      }
    }
  EXPECT_GT(pairs, 1000u);
}

TEST(Collide, meshes_that_touch_in_a_plane_collide_and_those_that_do_not_do_not) {
  const Mesh floor = shapes::grid(8, 8);
  const Bvh here = Bvh::build(floor.view());
  EXPECT_EQ(collide(here, here), brute_force(floor, floor));
  EXPECT_TRUE(collides(here, Bvh::build(moved(floor, {1, 0, 0}).view())));
  EXPECT_FALSE(collides(here, Bvh::build(moved(floor, {1.001f, 0, 0}).view())));
  EXPECT_FALSE(collides(here, Bvh::build(moved(floor, {0, 0, 0x1p-140f}).view())));
  // Surfaces collide, not what they enclose.
  const Mesh ball = shapes::sphere(2);
  Mesh within = ball;
  for (Vec3& p : within.positions) p = {p.x / 2, p.y / 2, p.z / 2};
  EXPECT_FALSE(collides(Bvh::build(ball.view()), Bvh::build(within.view())));
}

/// A turn and a shift, in double.
std::array<double, 12> pose(double angle, double x, double y, double z) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c, -s, 0, x, s * 0.6, c * 0.6, -0.8, y, s * 0.8, c * 0.8, 0.6, z};
}

Mesh placed(Mesh mesh, const std::array<double, 12>& rows) {
  for (Vec3& p : mesh.positions) {
    const auto on = [&](size_t r) {
      return static_cast<float>(rows[r] * p.x + rows[r + 1] * p.y + rows[r + 2] * p.z +
                                rows[r + 3]);
    };
    p = {on(0), on(4), on(8)};
  }
  return mesh;
}

TEST(Collide, a_mesh_that_was_placed_collides_as_one_that_was_built_there) {
  const Mesh first = shapes::blob(3, 4), second = shapes::torus(24, 12);
  const Bvh a = Bvh::build(first.view());
  for (const bool spatial : {false, true}) {
    BvhConfig config;
    if (spatial) config.tree.builder = bvh::Builder::kSpatial;
    config.compact = spatial;
    const Bvh b = Bvh::build(second.view(), config);
    for (int i = 0; i < 12; ++i) {
      CollisionOptions options;
      options.second_to_first = pose(0.5 * i, 0.2 * i, -0.1 * i, 0.05);
      EXPECT_EQ(collide(a, b, options),
                brute_force(first, placed(second, options.second_to_first)));
    }
  }
}

TEST(Collide, the_same_for_any_number_of_threads) {
  const Mesh first = shapes::blob(5, 1), second = shapes::torus(200, 100);
  const Bvh a = Bvh::build(first.view()), b = Bvh::build(second.view());
  CollisionOptions options;
  options.threads = 1;
  const auto truth = collide(a, b, options);
  EXPECT_GT(truth.size(), 100u);
  for (const uint32_t threads : {2u, 5u, 0u}) {
    options.threads = threads;
    EXPECT_EQ(collide(a, b, options), truth);
  }
}

TEST(Collide, nothing_collides_with_nothing_and_bad_maps_are_refused) {
  const Bvh ball = Bvh::build(shapes::sphere(1).view());
  EXPECT_TRUE(collide(Bvh(), ball).empty() && collide(ball, Bvh()).empty());
  CollisionOptions options;
  options.second_to_first[5] = NAN;
  EXPECT_THROW(collide(ball, ball, options), Error);
  options.second_to_first[5] = 1e39;
  EXPECT_THROW(collides(ball, ball, options), Error);
  options.second_to_first = {};  // to a point, which is a triangle too
  EXPECT_TRUE(collide(ball, ball, options).empty());
}

TEST(Collide, can_be_cancelled) {
  const Mesh blob = shapes::blob(4, 1);
  const Bvh bvh = Bvh::build(blob.view());
  CollisionOptions options;
  options.threads = 1;
  float last = 0;
  options.progress = [&](float fraction, std::string_view) {
    EXPECT_GE(fraction, std::exchange(last, fraction));
    return true;
  };
  EXPECT_FALSE(collide(bvh, bvh, options).empty());
  EXPECT_EQ(last, 1.0f);
  options.progress = [](float, std::string_view) { return false; };
  try {
    collide(bvh, bvh, options);
    FAIL() << "it was not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
}

TEST(Collide, asking_whether_can_be_cancelled) {
  // Needles along x and along y, a little above: every box of the ones meets every box of the
  // others, and no triangle does.
  Mesh along_x, along_y;
  for (uint32_t i = 0; i < 3000; ++i) {
    const float at = static_cast<float>(i);
    along_x.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    for (const Vec3& p : {Vec3{0, at, 0}, Vec3{6000, at, 0}, Vec3{6000, at, 3}})
      along_x.positions.push_back(p);
    for (const Vec3& p : {Vec3{at, 0, 2}, Vec3{at, 3000, 2}, Vec3{at, 0, 4}})
      along_y.positions.push_back({p.x + 0.5f, p.y - 0.5f, p.z});
  }
  along_y.triangles = along_x.triangles;
  const Bvh x = Bvh::build(along_x.view()), y = Bvh::build(along_y.view());
  for (const uint32_t threads : {1u, 2u}) {
    CollisionOptions options;
    options.threads = threads;
    size_t reports = 0;
    options.progress = [&](float, std::string_view) { return ++reports < 3; };
    try {
      collides(x, y, options);
      FAIL() << "it was not cancelled";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
    EXPECT_EQ(reports, 3u);
  }
}

TEST(Collide, real_meshes_equal_brute_force_near_their_surfaces) {
  const auto first = read_mesh("nasty_office_chair_7k.ply");
  const auto second = read_mesh("nasty_synth_dragon_tiny.ply");
  if (!first || !second) GTEST_SKIP() << "no meshes in " << data_folder();
  Mesh dragon = *second;
  const Aabb from = bounds(dragon.view()), to = bounds(first->view());
  const float scale = 0.5f * (to.max.x - to.min.x) / (from.max.x - from.min.x);
  for (Vec3& p : dragon.positions)
    p = {(p.x - from.min.x) * scale + to.min.x, (p.y - from.min.y) * scale + to.min.y,
         (p.z - from.min.z) * scale + to.min.z};
  const auto found = collide(Bvh::build(first->view()), Bvh::build(dragon.view()));
  const Bvh chair = Bvh::build(first->view());
  std::vector<TrianglePair> truth;
  for (uint32_t k = 0; k < dragon.triangles.size(); k += 50) {
    Aabb box;
    const auto second_corners = corners(dragon, k);
    for (const Vec3& p : second_corners) extend(box, p);
    for (const uint32_t i : chair.overlaps(box))
      if (triangles_meet(corners(*first, i), second_corners)) truth.push_back({i, k});
  }
  std::sort(truth.begin(), truth.end());
  std::vector<TrianglePair> some;
  for (const TrianglePair& pair : found)
    if (pair.second % 50 == 0) some.push_back(pair);
  EXPECT_EQ(some, truth);
  EXPECT_FALSE(found.empty());
}

}  // namespace
}  // namespace umbel
