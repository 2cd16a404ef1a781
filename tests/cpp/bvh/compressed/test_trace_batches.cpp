#include <gtest/gtest.h>

#include "bvh/compressed/halved_tree.hpp"
#include "bvh/compressed/trace_batches.hpp"
#include "bvh/oracle.hpp"

namespace umbel::cuda {
namespace {

using testing::HalvedTree;
using umbel::testing::adversarial_rays;
using umbel::testing::is_right;
using umbel::testing::rays_whose_t_overflows;
using umbel::testing::trace_all;
using umbel::testing::transformed;

struct Hits {
  std::vector<float> t, uvs;
  std::vector<uint32_t> primitives;

  Hit operator[](size_t i) const { return {t[i], primitives[i], uvs[2 * i], uvs[2 * i + 1]}; }
};

DeviceRays of(const std::vector<Ray>& rays, bool cull_back = false) {
  if (rays.empty()) return {};
  return {&rays[0].origin, &rays[0].direction, sizeof(Ray), sizeof(Ray), &rays[0].t_min,
          &rays[0].t_max,  sizeof(Ray),        rays.size(), cull_back};
}

Hits intersect(const bvh::CompactTree& tree, const DeviceRays& rays) {
  CpuExec exec;
  Hits hits{std::vector<float>(rays.count, -1), std::vector<float>(2 * rays.count, -1),
            std::vector<uint32_t>(rays.count, 77)};
  exec.for_each_traversal(
      rays.count,
      TraceRay<false>{
          tree, rays, {hits.t.data(), hits.primitives.data(), hits.uvs.data()}, nullptr});
  return hits;
}
Hits intersect(const bvh::CompactTree& tree, const std::vector<Ray>& rays, bool cull_back = false) {
  return intersect(tree, of(rays, cull_back));
}

std::vector<uint8_t> occluded(const bvh::CompactTree& tree, const DeviceRays& rays) {
  CpuExec exec;
  std::vector<uint8_t> results(rays.count, 9);
  exec.for_each_traversal(rays.count, TraceRay<true>{tree, rays, {}, results.data()});
  return results;
}
std::vector<uint8_t> occluded(const bvh::CompactTree& tree, const std::vector<Ray>& rays,
                              bool cull_back = false) {
  return occluded(tree, of(rays, cull_back));
}

void expect_hits_of(const TriangleQueries& expected, const bvh::CompactTree& tree,
                    const std::vector<Ray>& rays) {
  for (const bool cull_back : {false, true}) {
    const Hits hits = intersect(tree, rays, cull_back);
    const auto any = occluded(tree, rays, cull_back);
    RayOptions options;
    options.cull_back_faces = cull_back;
    for (size_t i = 0; i < rays.size(); ++i) {
      const Hit hit = expected.intersect(rays[i], options);
      ASSERT_EQ(hits[i], hit) << "ray " << i;
      ASSERT_EQ(any[i], hit.hit() ? 1 : 0) << "ray " << i;
    }
  }
}

std::vector<Mesh> meshes() {
  std::vector<Mesh> all = {shapes::sphere(3),  shapes::soup(700, 2), shapes::grid(20, 15),
                           shapes::blob(3, 5), shapes::soup(1, 1),   shapes::soup(9, 3)};
  Mesh flat = shapes::grid(8, 8);
  for (Vec3& p : flat.positions) p.z = 0;
  all.push_back(flat);
  Mesh same = shapes::soup(40, 4);
  for (Triangle& t : same.triangles) t = same.triangles[0];
  all.push_back(same);
  return all;
}

TEST(DeviceTrace, hits_are_those_of_the_processor_on_adversarial_rays) {
  for (const Mesh& mesh : meshes())
    for (const float scale : {1e-15f, 1e-4f, 1.0f, 1e6f, 1e15f, 1e28f}) {
      const Mesh scaled = transformed(mesh, scale);
      expect_hits_of(Bvh::build(scaled.view()), HalvedTree(scaled.view()).view(),
                     adversarial_rays(scaled.view(), 420, 3));
    }
}

TEST(DeviceTrace, masks_hide_triangles) {
  const Mesh mesh = shapes::soup(700, 2);
  std::vector<uint32_t> masks(mesh.triangles.size());
  for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1u << i % 3;
  const Bvh expected = Bvh::build(mesh.view(), {}, masks);
  const HalvedTree tree(mesh.view());
  const std::vector<Ray> rays = adversarial_rays(mesh.view(), 420, 3);
  for (const uint32_t mask : {0u, 1u, 2u, 6u, 8u, ~0u}) {
    DeviceRays given = of(rays);
    given.mask = mask;
    given.masks = masks.data();
    const Hits hits = intersect(tree.view(), given);
    const auto any = occluded(tree.view(), given);
    const RayOptions options{.mask = mask};
    for (size_t i = 0; i < rays.size(); ++i) {
      const Hit hit = expected.intersect(rays[i], options);
      ASSERT_EQ(hits[i], hit) << "ray " << i;
      ASSERT_EQ(any[i], hit.hit() ? 1 : 0) << "ray " << i;
    }
    given.masks = nullptr;  // all bits set
    EXPECT_EQ(intersect(tree.view(), given).primitives,
              mask == 0 ? std::vector<uint32_t>(rays.size(), kNone)
                        : intersect(tree.view(), rays).primitives);
  }
}

TEST(DeviceTrace, hits_far_from_the_origin_are_those_of_the_processor) {
  const Mesh mesh = transformed(shapes::sphere(3), 1, {1000, -2000, 500});
  expect_hits_of(Bvh::build(mesh.view()), HalvedTree(mesh.view()).view(),
                 adversarial_rays(mesh.view(), 1400, 4));
}

TEST(DeviceTrace, hits_are_those_of_brute_force) {
  for (const Mesh& mesh : meshes()) {
    const HalvedTree tree(mesh.view(), 5);
    const auto rays = adversarial_rays(mesh.view(), 280, 6);
    const Hits hits = intersect(tree.view(), rays);
    for (size_t i = 0; i < rays.size(); ++i)
      ASSERT_TRUE(is_right(mesh.view(), rays[i], trace_all(mesh.view(), rays[i]), hits[i]))
          << "ray " << i;
  }
}

TEST(DeviceTrace, origins_and_directions_may_be_any_finite_ones) {
  const Mesh mesh = transformed(shapes::sphere(2), 1e37f, {1.2e38f, 1.2e38f, 2e38f});
  const std::vector<Ray> rays = {{{1.2e38f, 1.2e38f, 1.1e38f}, 0, {0, 0, 1}},
                                 {{1.2e38f, 1.2e38f, 1.1e38f}, 0, {0, 0, 3e38f}}};
  const HalvedTree tree(mesh.view());
  for (const Hit& hit : {intersect(tree.view(), rays)[0], intersect(tree.view(), rays)[1]})
    EXPECT_TRUE(hit.hit());
  expect_hits_of(Bvh::build(mesh.view()), tree.view(), rays);
}

TEST(DeviceTrace, what_lies_at_a_t_that_overflows_is_missed) {
  const Mesh mesh = shapes::sphere(2);
  const std::vector<Ray> rays = rays_whose_t_overflows();
  const HalvedTree tree(mesh.view());
  const Hits hits = intersect(tree.view(), rays);
  for (size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(hits[i], Hit{}) << i;
  EXPECT_EQ(occluded(tree.view(), rays), std::vector<uint8_t>(rays.size(), 0));
  expect_hits_of(Bvh::build(mesh.view()), tree.view(), {{{0.01f, 0.02f, -3}, 0, {0, 0, 8e-39f}}});
}

// Rays at edges and vertices of a closed surface, from within, all hit it.
TEST(DeviceTrace, nothing_passes_between_triangles) {
  for (const float scale : {1e-15f, 1.0f, 1e15f}) {
    const Mesh mesh = transformed(shapes::sphere(4), scale);
    std::vector<Ray> rays;
    for (const Triangle& t : mesh.triangles)
      for (int k = 0; k < 3; ++k) {
        const Vec3 &a = mesh.positions[t[k]], &b = mesh.positions[t[(k + 1) % 3]];
        rays.push_back({{0.01f * scale, 0.02f * scale, 0}, 0, a});
        rays.push_back({{0, 0, 0.01f * scale}, 0, (a + b) * 0.5f});
      }
    const auto any = occluded(HalvedTree(mesh.view()).view(), rays);
    EXPECT_EQ(std::count(any.begin(), any.end(), 1), ptrdiff_t(rays.size()));
  }
}

TEST(DeviceTrace, rays_that_cannot_hit_do_not) {
  const Mesh mesh = shapes::sphere(2);
  const HalvedTree tree(mesh.view());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const std::vector<Ray> rays = {{{0, 0, 0}, 0, {0, 0, 0}},       {{nan, 0, 0}, 0, {1, 0, 0}},
                                 {{0, 0, 0}, nan, {1, 0, 0}},     {{0, 0, 0}, 0, {1, nan, 0}},
                                 {{inf, 0, 0}, 0, {1, 0, 0}},     {{0, 0, 0}, 2, {1, 0, 0}, 1},
                                 {{0, 0, 0}, 0, {1, 0, 0}, 0.5f}, {{0, 0, 0}, 1.5f, {1, 0, 0}},
                                 {{0, 0, 0}, 0, {inf, 0, 0}},     {{3, 3, 3}, 0, {1, 0, 0}}};
  const Hits hits = intersect(tree.view(), rays);
  for (size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(hits[i], Hit{}) << i;
  EXPECT_EQ(occluded(tree.view(), rays), std::vector<uint8_t>(rays.size(), 0));
  const HalvedTree none(MeshView{});
  EXPECT_EQ(intersect(none.view(), {{{0, 0, 0}, 0, {1, 0, 0}}})[0], Hit{});
}

TEST(DeviceTrace, triangles_that_are_not_finite_are_not_there) {
  Mesh mesh = shapes::soup(60, 8);
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity()};
  for (size_t i = 0; i < 20; ++i) (&mesh.positions[7 * i].x)[i % 3] = bad[i % 2];
  Mesh finite = mesh;
  for (Triangle& t : finite.triangles)
    if (std::any_of(t.begin(), t.end(), [&](uint32_t v) { return !is_finite(mesh.positions[v]); }))
      t = {0, 0, 0};
  const HalvedTree tree(mesh.view());
  const std::vector<Ray> rays = adversarial_rays(shapes::soup(60, 8).view(), 300, 9);
  const Hits hits = intersect(tree.view(), rays);
  size_t found = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (!hits[i].hit()) continue;
    ++found;
    EXPECT_NE(finite.triangles[hits[i].primitive], (Triangle{0, 0, 0}));
  }
  EXPECT_GT(found, 50u);
}

TEST(DeviceTrace, separate_arrays_and_the_number_of_threads_change_nothing) {
  const Mesh mesh = shapes::blob(4, 6);
  const HalvedTree tree(mesh.view());
  const auto rays = adversarial_rays(mesh.view(), 3000, 10);
  std::vector<float> origins, directions, t_min, t_max;
  for (const Ray& r : rays) {
    for (const float v : {r.origin.x, r.origin.y, r.origin.z, 7.0f}) origins.push_back(v);
    for (const float v : {r.direction.x, r.direction.y, r.direction.z}) directions.push_back(v);
    t_min.push_back(r.t_min), t_max.push_back(r.t_max);
  }
  const DeviceRays apart{origins.data(), directions.data(), 16, 12,
                         t_min.data(),   t_max.data(),      4,  rays.size()};
  std::vector<uint32_t> primitives(rays.size());
  CpuExec exec;
  with_threads(7, [&] {
    exec.for_each_traversal(
        rays.size(),
        TraceRay<false>{tree.view(), apart, {nullptr, primitives.data(), nullptr}, nullptr});
  });
  with_threads(1, [&] { EXPECT_EQ(primitives, intersect(tree.view(), rays).primitives); });
}

// ---- shapes -------------------------------------------------------------------------------

std::vector<Vec3> points_around(const Mesh& mesh, size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1, 1);
  const Aabb box = bounds(mesh.view());
  const Vec3 middle = center(box), size = box.max - box.min;
  const float extent = std::max({size.x, size.y, size.z});
  std::vector<Vec3> points;
  for (size_t i = 0; i < count; ++i) {
    const float reach = extent * (i % 5 == 0 ? 30.0f : 0.7f);
    points.push_back(middle + Vec3{unit(random), unit(random), unit(random)} * reach);
    if (i % 7 == 0) points.back() = mesh.positions[random() % mesh.positions.size()];
  }
  return points;
}

TEST(DeviceTrace, closest_points_are_those_of_the_processor) {
  for (const Mesh& mesh : meshes())
    for (const float scale : {1e-15f, 1.0f, 1e15f}) {
      const Mesh scaled = transformed(mesh, scale);
      const Bvh expected = Bvh::build(scaled.view());
      const HalvedTree tree(scaled.view());
      const auto points = points_around(scaled, 200, 11);
      for (const float reach : {std::numeric_limits<float>::infinity(), 0.3f * scale, 0.0f}) {
        std::vector<ClosestPoint> found(points.size());
        std::vector<Vec3> places(points.size());
        std::vector<float> distances(points.size()), uvs(2 * points.size());
        std::vector<uint32_t> primitives(points.size());
        CpuExec exec;
        exec.for_each_traversal(
            points.size(),
            FindClosest{tree.view(),
                        {points.data(), sizeof(Vec3), points.size(), reach},
                        {&places[0].x, distances.data(), primitives.data(), uvs.data()}});
        for (size_t i = 0; i < points.size(); ++i) {
          const ClosestPoint e = expected.closest_point(points[i], reach);
          ASSERT_EQ(primitives[i], e.primitive) << i;
          ASSERT_EQ(distances[i], e.distance);
          ASSERT_EQ(places[i], e.point);
          ASSERT_EQ(uvs[2 * i], e.u);
          ASSERT_EQ(uvs[2 * i + 1], e.v);
        }
      }
    }
}

std::vector<Aabb> boxes_around(const Mesh& mesh, size_t count) {
  const auto a = points_around(mesh, count, 12), b = points_around(mesh, count, 13);
  std::vector<Aabb> boxes;
  for (size_t i = 0; i < count; ++i) {
    const float share = i % 3 == 0 ? 1.0f : 0.05f;
    const Vec3 other = a[i] + (b[i] - a[i]) * share;
    boxes.push_back({min(a[i], other), max(a[i], other)});
    if (i % 11 == 0) boxes.back() = {a[i], a[i]};
    if (i % 13 == 0) std::swap(boxes.back().min, boxes.back().max);
  }
  return boxes;
}

TEST(DeviceTrace, overlaps_are_those_of_the_processor) {
  for (const Mesh& mesh : meshes()) {
    const Bvh expected = Bvh::build(mesh.view());
    const HalvedTree tree(mesh.view());
    auto boxes = boxes_around(mesh, 150);
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    boxes[0].max.x = boxes[1].max.z = kInfinity;
    boxes[1].min = {-kInfinity, -kInfinity, -kInfinity};
    const auto count = uint32_t(boxes.size());
    CpuExec exec;
    std::vector<uint32_t> offsets(count + 1, 99);
    count_touching(exec, tree.view(), boxes.data(), count, offsets.data());
    const std::vector<uint32_t> counted = offsets;
    std::vector<uint32_t> primitives(offsets.back() + 5, 99);
    list_touching(exec, tree.view(), boxes.data(), count, offsets.data(), primitives.data(),
                  offsets.back());
    EXPECT_EQ(offsets, counted);  // each triangle is in one leaf
    for (uint32_t i = 0; i < count; ++i)
      ASSERT_EQ(std::vector<uint32_t>(primitives.begin() + offsets[i],
                                      primitives.begin() + offsets[i + 1]),
                expected.overlaps(boxes[i]));
    EXPECT_EQ(std::count(primitives.end() - 5, primitives.end(), 99u), 5);
    // With less room, less is listed, and nothing beyond it written.
    if (counted.back() < 2) continue;
    const uint32_t room = counted.back() / 2;
    offsets = counted;
    std::fill(primitives.begin(), primitives.end(), 99u);
    list_touching(exec, tree.view(), boxes.data(), count, offsets.data(), primitives.data(), room);
    EXPECT_EQ(offsets.back(), room);
    EXPECT_EQ(std::count(primitives.begin() + room, primitives.end(), 99u),
              ptrdiff_t(primitives.size() - room));
  }
}

TEST(DeviceTrace, triangles_in_several_leaves_are_listed_once) {
  Mesh twice = shapes::sphere(3);
  const size_t n = twice.triangles.size();
  for (size_t i = 0; i < n; ++i) twice.triangles.push_back(twice.triangles[i]);
  HalvedTree tree(twice.view());
  // The second half are the first once more.
  std::vector<bvh::CompactTriangle> triangles(tree.view().triangles, tree.view().triangles + 2 * n);
  for (bvh::CompactTriangle& t : triangles) t.primitive %= uint32_t(n);
  const bvh::CompactTree view{tree.view().nodes, triangles.data(), tree.view().info};
  const Aabb box{{-0.2f, -0.2f, 0}, {0.3f, 0.4f, 2}};
  std::vector<uint32_t> offsets(2);
  CpuExec exec;
  count_touching(exec, view, &box, 1, offsets.data());
  std::vector<uint32_t> primitives(offsets[1]);
  list_touching(exec, view, &box, 1, offsets.data(), primitives.data(), offsets[1]);
  EXPECT_EQ(2 * offsets[1], primitives.size());
  primitives.resize(offsets[1]);
  EXPECT_EQ(primitives, Bvh::build(shapes::sphere(3).view()).overlaps(box));
}

}  // namespace
}  // namespace umbel::cuda
