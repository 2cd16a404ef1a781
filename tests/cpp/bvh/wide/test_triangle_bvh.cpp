// Ray kernels: the same answers from every instruction set, watertight at every scale, and what
// options and intervals mean. test_oracle.cpp compares them with brute force.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "base/math.hpp"
#include "bvh/oracle.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel {
namespace {

using testing::simd_paths;

Bvh build(const Mesh& mesh, uint32_t width, bool compact, Simd simd,
          std::span<const uint32_t> masks = {}) {
  BvhConfig config;
  config.width = width;
  config.compact = compact;
  config.simd = simd;
  return Bvh::build(mesh.view(), config, masks);
}

/// Half of them random, half from far away at a vertex or the middle of an edge.
std::vector<Ray> mixed_rays(const Mesh& mesh, size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> real(-1.0f, 1.0f);
  const Aabb box = bounds(mesh.view());
  const Vec3 middle = center(box), half = (box.max - box.min) * 0.5f;
  const auto point = [&](float size) {
    return middle +
           Vec3{real(random) * half.x, real(random) * half.y, real(random) * half.z} * size;
  };
  std::vector<Ray> rays(count);
  for (size_t i = 0; i < count; ++i) {
    rays[i].origin = point(3.0f);
    const Triangle& triangle = mesh.triangles[random() % mesh.triangles.size()];
    Vec3 target = point(1.0f);
    if (i % 4 == 1) target = mesh.positions[triangle[0]];
    if (i % 4 == 3) target = (mesh.positions[triangle[0]] + mesh.positions[triangle[1]]) * 0.5f;
    rays[i].direction = target - rays[i].origin;
    if (i % 16 == 0) rays[i].direction.x = 0.0f;
    if (i % 32 == 0) rays[i].direction.y = -0.0f;
    if (i % 5 == 0) rays[i].t_min = 0.5f;
    if (i % 7 == 0) rays[i].t_max = 1.5f;
  }
  return rays;
}

TEST(Rays, instruction_sets_widths_and_forms_give_the_same_bits) {
  for (const Mesh& mesh : {shapes::blob(4, 3), shapes::soup(3000, 1), shapes::grid(40, 40)}) {
    const std::vector<Ray> rays = mixed_rays(mesh, 4000);
    std::vector<Hit> expected(rays.size()), hits(rays.size());
    build(mesh, 2, false, Simd::kPortable).intersect(rays, expected);
    for (const Simd simd : simd_paths())
      for (const uint32_t width : {2u, 4u, 8u})
        for (const bool compact : {false, true}) {
          const Bvh tree = build(mesh, width, compact, simd);
          tree.intersect(rays, hits);
          EXPECT_EQ(hits, expected)
              << width << " wide, compact " << compact << ", path " << static_cast<uint32_t>(simd);
          for (size_t i = 0; i < rays.size(); ++i)
            ASSERT_EQ(tree.occluded(rays[i]), hits[i].hit()) << i;
        }
  }
}

TEST(Rays, no_ray_passes_between_triangles_at_any_scale) {
  const Mesh sphere = shapes::blob(3, 5);
  for (const Simd simd : simd_paths())
    for (const float scale : {1e-15f, 1e-7f, 1.0f, 1e7f, 1e15f}) {
      const Mesh mesh = testing::transformed(sphere, scale);
      const Bvh tree = build(mesh, 8, false, simd);
      for (const float length : {1e-15f, 1.0f, 1e15f})
        for (const Triangle& triangle : mesh.triangles)
          for (uint32_t corner = 0; corner < 3; ++corner) {
            const Vec3 a = sphere.positions[triangle[corner]];
            const Vec3 b = sphere.positions[triangle[(corner + 1) % 3]];
            Ray ray;  // from the middle, which the surface surrounds
            ray.direction = a * length;
            ASSERT_TRUE(tree.intersect(ray).hit()) << "vertex, scale " << scale;
            ray.direction = (a + b) * length;
            ASSERT_TRUE(tree.intersect(ray).hit()) << "edge, scale " << scale;
          }
    }
}

TEST(Rays, the_distance_scales_with_the_direction) {
  const Mesh mesh = shapes::sphere(3);
  for (const Simd simd : simd_paths()) {
    const Bvh tree = build(mesh, 8, false, simd);
    for (const float length : {0x1p-60f, 0x1p-1f, 1.0f, 0x1p60f}) {
      Ray ray;
      ray.origin = {0.1f, 0.2f, -3};
      ray.direction = {0, 0, length};
      const Hit hit = tree.intersect(ray);
      ASSERT_TRUE(hit.hit());
      EXPECT_NEAR(hit.t * length, 2.026f, 0.02f);
      ray.t_max = hit.t;
      EXPECT_EQ(tree.intersect(ray), hit);
      ray.t_max = std::nextafter(hit.t, 0.0f);
      EXPECT_FALSE(tree.intersect(ray).hit());
      ray.t_max = std::numeric_limits<float>::infinity();
      ray.t_min = std::nextafter(hit.t, 1e30f);
      EXPECT_GT(tree.intersect(ray).t, hit.t);
    }
  }
}

TEST(Rays, of_equal_distances_the_lowest_primitive_is_hit) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles.assign(500, {0, 1, 2});
  for (const Simd simd : simd_paths())
    for (const uint32_t width : {2u, 4u, 8u}) {
      const Bvh tree = build(mesh, width, false, simd);
      Ray ray;
      ray.origin = {0.25f, 0.25f, 1};
      ray.direction = {0, 0, -1};
      EXPECT_EQ(tree.intersect(ray), (Hit{1, 0, 0.25f, 0.25f}));
      std::vector<Hit> hits(600);
      ASSERT_EQ(tree.all_hits(ray, hits), 500u);
      for (uint32_t i = 0; i < 500; ++i) ASSERT_EQ(hits[i].primitive, i);
      ASSERT_EQ(tree.all_hits(ray, std::span(hits).first(7)), 7u);
      for (uint32_t i = 0; i < 7; ++i) ASSERT_EQ(hits[i].primitive, i);
    }
}

TEST(Rays, all_hits_are_those_found_by_going_on_behind_each) {
  const Mesh mesh = shapes::soup(2000, 9);
  const std::vector<Ray> rays = mixed_rays(mesh, 300);
  for (const Simd simd : simd_paths()) {
    const Bvh tree = build(mesh, 8, false, simd);
    for (Ray ray : rays) {
      std::vector<Hit> hits(64);
      hits.resize(tree.all_hits(ray, hits));
      for (const Hit& hit : hits) {
        ASSERT_EQ(tree.intersect(ray), hit);
        ray.t_min = std::nextafter(hit.t, 1e30f);
      }
      if (hits.size() < 64) ASSERT_FALSE(tree.intersect(ray).hit());
    }
  }
}

TEST(Rays, the_nearest_of_many_hits_are_those_before_all_others) {
  // Layers in random order and, every third, twice; and a needle across all of them, which spatial
  // splits put into many leaves.
  Mesh mesh;
  std::vector<uint32_t> order(3000);
  std::iota(order.begin(), order.end(), 0u);
  std::shuffle(order.begin(), order.end(), std::mt19937(4));
  const auto add = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto n = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {a, b, c});
    mesh.triangles.push_back({n, n + 1, n + 2});
  };
  for (const uint32_t layer : order) {
    const float z = static_cast<float>(layer - layer % 3 % 2);
    add({0, 0, z}, {1, 0, z}, {0, 1, z});
    if (layer % 10 == 0) add({0, 0, -1}, {1, 0, 3000}, {0, 1, 3000 - z});
  }
  for (const Ray& ray :
       {Ray{{0.25f, 0.25f, -5}, 0, {0, 0, 1}}, Ray{{0.25f, 0.25f, 4000}, 0, {0, 0, -1}}}) {
    std::vector<Hit> all(mesh.triangles.size() + 1);
    const Bvh reference = Bvh::build(mesh.view());
    all.resize(reference.all_hits(ray, all));
    EXPECT_GE(all.size(), 3000u);
    EXPECT_TRUE(std::is_sorted(all.begin(), all.end(), [](const Hit& a, const Hit& b) {
      return a.t != b.t ? a.t < b.t : a.primitive < b.primitive;
    }));
    for (const Simd simd : simd_paths()) {
      BvhConfig config;
      config.tree.builder = bvh::Builder::kSpatial;
      config.tree.spatial_overlap = 0;
      config.simd = simd;
      const Bvh tree = Bvh::build(mesh.view(), config);
      for (const size_t most : {1u, 7u, 63u, 64u, 65u, 66u, 100u, 1000u, 2999u, 10000u}) {
        std::vector<Hit> hits(most);
        hits.resize(tree.all_hits(ray, hits));
        ASSERT_EQ(hits.size(), std::min(most, all.size()));
        ASSERT_TRUE(std::equal(hits.begin(), hits.end(), all.begin())) << most;
      }
    }
  }
}

TEST(Rays, only_triangles_that_the_mask_sees_are_hit) {
  const Mesh mesh = shapes::soup(1000, 4);
  std::vector<uint32_t> masks(mesh.triangles.size());
  Mesh odd = mesh;
  odd.triangles.clear();
  for (size_t i = 0; i < masks.size(); ++i) {
    masks[i] = i % 2 ? 2 : 1;
    if (i % 2) odd.triangles.push_back(mesh.triangles[i]);
  }
  const std::vector<Ray> rays = mixed_rays(mesh, 1000);
  for (const Simd simd : simd_paths()) {
    const Bvh masked = build(mesh, 8, false, simd, masks), alone = build(odd, 8, false, simd);
    RayOptions options;
    options.mask = 2;
    for (const Ray& ray : rays) {
      Hit expected = alone.intersect(ray);
      if (expected.hit()) expected.primitive = 2 * expected.primitive + 1;
      ASSERT_EQ(masked.intersect(ray, options), expected);
      ASSERT_EQ(masked.occluded(ray, options), expected.hit());
    }
    options.mask = 0;
    EXPECT_FALSE(masked.occluded(rays[1], options));
    EXPECT_FALSE(alone.intersect(rays[1], options).hit());
  }
}

TEST(Rays, back_faces_are_passed_when_asked) {
  const Mesh mesh = shapes::sphere(3);
  RayOptions options;
  options.cull_back_faces = true;
  for (const Simd simd : simd_paths()) {
    const Bvh tree = build(mesh, 8, false, simd);
    for (const Ray& outer : mixed_rays(mesh, 500)) {
      Ray ray;
      ray.direction = outer.direction;
      EXPECT_TRUE(tree.intersect(ray).hit());
      EXPECT_FALSE(tree.intersect(ray, options).hit()) << "from inside";
      ray.origin = outer.direction * (-3.0f / length(outer.direction));
      EXPECT_EQ(tree.intersect(ray, options), tree.intersect(ray)) << "from outside";
    }
  }
}

TEST(Rays, what_is_no_ray_hits_nothing) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const Mesh mesh = shapes::sphere(2);
  for (const Simd simd : simd_paths()) {
    const Bvh tree = build(mesh, 8, false, simd);
    for (const float bad : {nan, infinity, -infinity}) {
      EXPECT_FALSE(tree.intersect({{bad, 0, 0}, 0, {0, 0, 1}, infinity}).hit());
      EXPECT_FALSE(tree.intersect({{0, 0, 0}, 0, {0, bad, 1}, infinity}).hit());
    }
    EXPECT_FALSE(tree.intersect({{0, 0, 0}, 0, {0, 0, 0}, infinity}).hit());
    EXPECT_FALSE(tree.intersect({{0, 0, 0}, nan, {0, 0, 1}, infinity}).hit());
    EXPECT_FALSE(tree.intersect({{0, 0, 0}, 0, {0, 0, 1}, nan}).hit());
    EXPECT_FALSE(tree.intersect({{0, 0, 0}, 5, {0, 0, 1}, 4}).hit());
    EXPECT_TRUE(tree.intersect({{0, 0, 0}, -infinity, {0, 0, 1}, 0}).hit()) << "behind the origin";
  }
}

TEST(Rays, what_is_no_instruction_set_is_refused) {
  BvhConfig config;
  config.simd = static_cast<Simd>(4);
  try {
    Bvh::build(shapes::blob(2, 1).view(), config);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_STREQ(error.what(), "simd is 4, but its values are 0 to 3");
  }
}

TEST(Rays, a_tree_without_triangles_answers) {
  Bvh empty = Bvh::build({});
  const Ray ray{{0, 0, 0}, 0, {0, 0, 1}, 1};
  std::vector<Hit> hits(4);
  EXPECT_FALSE(empty.intersect(ray).hit());
  EXPECT_FALSE(Bvh().occluded(ray));
  EXPECT_EQ(empty.all_hits(ray, hits), 0u);
  const Bvh moved = std::move(empty);
  EXPECT_FALSE(empty.occluded(ray));  // NOLINT(bugprone-use-after-move)
  EXPECT_FALSE(moved.occluded(ray));
}

TEST(Rays, batches_do_not_depend_on_threads) {
  const Mesh mesh = shapes::blob(4, 3);
  const Bvh tree = Bvh::build(mesh.view());
  const std::vector<Ray> rays = mixed_rays(mesh, 3000);
  std::vector<Hit> one(rays.size()), two(rays.size());
  tree.intersect(rays, one, {}, 1);
  tree.intersect(rays, two, {}, 2);
  EXPECT_EQ(one, two);
  EXPECT_THROW(tree.intersect(rays, std::span(one).first(5)), Error);
}

}  // namespace
}  // namespace umbel
