#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"
#include "kdtree/meshes.hpp"
#include "umbel/kdtree_traverse.hpp"

namespace umbel {
namespace {

using namespace testing;
using bvh::NamedBoxes;
using bvh::nasty_boxes;
using bvh::random_boxes;
using bvh::with_thread_count;
using kdtree::Config;
using kdtree::Tree;

constexpr kdtree::Builder kBuilders[] = {kdtree::Builder::kExact, kdtree::Builder::kBinned};

bool meet(const Aabb& a, const Aabb& b) {
  return a.min.x <= b.max.x && a.max.x >= b.min.x && a.min.y <= b.max.y && a.max.y >= b.min.y &&
         a.min.z <= b.max.z && a.max.z >= b.min.z;
}

struct Ball {
  Vec3 centre;
  float radius;
};

std::vector<Ball> balls(uint32_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1, 1);
  std::vector<Ball> result(count);
  for (Ball& ball : result)
    ball = {{unit(random), unit(random), unit(random)}, 0.02f + 0.05f * std::abs(unit(random))};
  return result;
}

std::vector<Aabb> boxes_of(const std::vector<Ball>& all) {
  std::vector<Aabb> result;
  for (const auto& [c, r] : all)
    result.push_back({{c.x - r, c.y - r, c.z - r}, {c.x + r, c.y + r, c.z + r}});
  return result;
}

/// Where a ray enters a ball, or infinity.
float entry(const Ray& ray, const Ball& ball) {
  const double d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  const double o[3] = {double(ray.origin.x) - ball.centre.x, double(ray.origin.y) - ball.centre.y,
                       double(ray.origin.z) - ball.centre.z};
  double dd = 0, od = 0, oo = 0;
  for (int i = 0; i < 3; ++i) dd += d[i] * d[i], od += o[i] * d[i], oo += o[i] * o[i];
  const double root = od * od - dd * (oo - double(ball.radius) * ball.radius);
  if (root < 0) return INFINITY;
  const double t = (-od - std::sqrt(root)) / dd;
  return t >= double(ray.t_min) && t <= double(ray.t_max) ? static_cast<float>(t) : INFINITY;
}

TEST(KdTreeBoxes, every_box_is_in_every_leaf_that_it_reaches_into) {
  for (const NamedBoxes& named : nasty_boxes()) {
    SCOPED_TRACE(named.name);
    for (const kdtree::Builder builder : kBuilders) {
      Config config;
      config.builder = builder;
      const Tree tree = kdtree::build(named.boxes, config);
      kdtree::check(tree, static_cast<uint32_t>(named.boxes.size()));
      std::vector<uint8_t> seen(named.boxes.size());
      for (const uint32_t i : tree.references) seen[i] = 1;
      EXPECT_EQ(std::count(seen.begin(), seen.end(), 1), std::ptrdiff_t(seen.size()));
      // Whatever overlaps a region is found in it.
      for (size_t k = 0; k < named.boxes.size(); k += 1 + named.boxes.size() / 20) {
        const Aabb& region = named.boxes[k];
        std::vector<uint8_t> found(named.boxes.size());
        kdtree::traverse(tree, region, [&](std::span<const uint32_t> primitives) {
          for (const uint32_t i : primitives) found[i] = 1;
          return true;
        });
        for (size_t i = 0; i < named.boxes.size(); ++i)
          ASSERT_TRUE(found[i] || !meet(named.boxes[i], region)) << "box " << i;
      }
    }
  }
}

TEST(KdTreeBoxes, nearest_balls_along_rays_equal_brute_force) {
  const std::vector<Ball> all = balls(600, 1);
  const Mesh around = shapes::sphere(2);
  size_t hits = 0, visits = 0, tests = 0;
  for (const kdtree::Builder builder : kBuilders) {
    Config config;
    config.builder = builder;
    const Tree tree = kdtree::build(boxes_of(all), config);
    for (Ray ray : adversarial_rays(around.view(), 1400, 3)) {
      if (!std::isfinite(ray.direction.x + ray.direction.y + ray.direction.z)) continue;
      float truth = INFINITY;
      for (const Ball& ball : all) truth = std::min(truth, entry(ray, ball));
      float nearest = ray.t_max;
      kdtree::traverse(tree, ray, [&](std::span<const uint32_t> primitives) {
        for (const uint32_t i : primitives) nearest = std::min(nearest, entry(ray, all[i]));
        tests += primitives.size();
        return nearest;
      });
      if (std::isfinite(truth)) {
        ASSERT_EQ(nearest, truth);
        ++hits;
      } else {
        ASSERT_EQ(nearest, ray.t_max);
      }
      ++visits;
    }
  }
  EXPECT_GT(hits, 200u);
  EXPECT_LT(tests, visits * all.size() / 10);
}

TEST(KdTreeBoxes, axis_aligned_rays_in_planes_between_boxes_find_all_neighbours) {
  std::vector<Aabb> cubes;
  for (int x = 0; x < 6; ++x)
    for (int y = 0; y < 6; ++y)
      for (int z = 0; z < 6; ++z)
        cubes.push_back(
            {{float(x), float(y), float(z)}, {float(x + 1), float(y + 1), float(z + 1)}});
  const Tree tree = kdtree::build(cubes);
  for (int y = 0; y <= 6; ++y)
    for (const float dy : {0.0f, -0.0f}) {
      std::vector<uint8_t> found(cubes.size());
      kdtree::traverse(tree, Ray{{-1, float(y), 2}, 0, {1, dy, 0}},
                       [&](std::span<const uint32_t> primitives) {
                         for (const uint32_t i : primitives) found[i] = 1;
                         return INFINITY;
                       });
      for (size_t i = 0; i < cubes.size(); ++i) {
        const bool touches = cubes[i].min.y <= float(y) && cubes[i].max.y >= float(y) &&
                             cubes[i].min.z <= 2 && cubes[i].max.z >= 2;
        if (touches) {
          ASSERT_TRUE(found[i]) << y << ", cube " << i;
        }
      }
    }
}

TEST(KdTreeBoxes, rays_may_have_any_finite_origin_and_direction) {
  const Aabb box{{1e38f, 1e38f, 1e38f}, {2e38f, 2e38f, 2e38f}};
  const Tree tree = kdtree::build(std::span(&box, 1));
  for (const Ray& ray : {Ray{{1.5e38f, 1.5e38f, 1.5e38f}, 0, {0, 0, -1}},
                         Ray{{0, 0, 0}, 0, {1.5e38f, 1.5e38f, 1.5e38f}}}) {
    size_t visits = 0;
    kdtree::traverse(tree, ray, [&](std::span<const uint32_t> primitives) {
      visits += primitives.size();
      return ray.t_max;
    });
    EXPECT_EQ(visits, 1u);
  }
}

TEST(KdTreeBoxes, the_same_for_any_number_of_threads) {
  const std::vector<Aabb> boxes = random_boxes(20000, 5);
  const Tree one = kdtree::build(boxes, {}, with_thread_count(1));
  for (const uint32_t threads : {2u, 5u}) {
    const Tree again = kdtree::build(boxes, {}, with_thread_count(threads));
    EXPECT_EQ(again.references, one.references);
    EXPECT_EQ(again.nodes.size(), one.nodes.size());
  }
}

TEST(KdTreeBoxes, a_target_leaf_size_ends_splits) {
  const Mesh mesh = shapes::blob(4, 1);
  for (const kdtree::Builder builder : kBuilders) {
    Config config;
    config.builder = builder;
    size_t last = kdtree::build(mesh.view(), config).nodes.size();
    for (const uint32_t target : {8u, 40u, 255u}) {
      config.target_leaf_size = target;
      const Tree tree = kdtree::build(mesh.view(), config);
      EXPECT_LT(tree.nodes.size(), last);
      last = tree.nodes.size();
      // An inner node had more than that many.
      for (size_t i = 0; i + 1 < tree.nodes.size(); ++i) {
        if (tree.nodes[i].is_leaf()) continue;
        const kdtree::Node &below = tree.nodes[i + 1], &above = tree.nodes[tree.nodes[i].above()];
        if (below.is_leaf() && above.is_leaf()) {
          EXPECT_GT(below.count() + above.count(), target);
        }
      }
    }
    config.target_leaf_size = 256;
    EXPECT_THROW(kdtree::build(mesh.view(), config), Error);
  }
}

TEST(KdTreeBoxes, an_empty_region_touches_nothing) {
  const std::vector<Aabb> boxes(3, Aabb{{0, 0, 0}, {1, 1, 1}});
  const kdtree::Tree tree = kdtree::build(boxes);
  EXPECT_EQ(kdtree::overlaps(tree, boxes, {{1, 1, 1}, {1, 1, 1}}).size(), 3u);
  EXPECT_TRUE(kdtree::overlaps(tree, boxes, {{1, 0, 0}, {0, 1, 1}}).empty());
}

TEST(KdTreeBoxes, refuses_what_is_no_box) {
  std::vector<Aabb> boxes = random_boxes(10, 1);
  EXPECT_TRUE(kdtree::build(std::span<const Aabb>()).nodes.empty());
  boxes[3].min.x = NAN;
  EXPECT_THROW(kdtree::build(boxes), Error);
  boxes[3] = Aabb{};
  EXPECT_THROW(kdtree::build(boxes), Error);
}

}  // namespace
}  // namespace umbel
