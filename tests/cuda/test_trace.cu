#include <random>

#include "any_mesh.hpp"
#include "bvh/compressed/halved_tree.hpp"
#include "bvh/oracle.hpp"
#include "device_arrays.cuh"
#include "umbel/cuda_trace.hpp"
#include "umbel/umbel_cuda_trace.h"

namespace umbel::cuda {
namespace {

using umbel::testing::adversarial_rays;
using umbel::testing::transformed;

/// A tree made on the host, on the device.
struct Tree {
  DeviceArray<bvh::CompactNode> nodes;
  DeviceArray<bvh::CompactTriangle> triangles;
  DeviceArray<bvh::CompactInfo> info;

  explicit Tree(const Mesh& mesh) : Tree(testing::HalvedTree(mesh.view()).view()) {}
  DeviceBvh view() const { return {nodes.data(), triangles.data(), info.data()}; }

 private:
  explicit Tree(const bvh::CompactTree& t)
      : nodes(std::vector<bvh::CompactNode>(t.nodes, t.nodes + t.info->nodes)),
        triangles(std::vector<bvh::CompactTriangle>(t.triangles, t.triangles + t.info->triangles)),
        info(std::vector<bvh::CompactInfo>{*t.info}) {}
};

DeviceRays rays_of(const DeviceArray<Ray>& rays, bool cull_back = false) {
  const Ray* first = rays.data();
  return {&first->origin, &first->direction, sizeof(Ray), sizeof(Ray), &first->t_min,
          &first->t_max,  sizeof(Ray),       rays.size(), cull_back};
}

std::vector<Mesh> meshes() {
  std::vector<Mesh> all = {shapes::soup(1, 1), shapes::blob(kEmulated ? 1 : 3, 5)};
  if (!kEmulated) {
    all.push_back(shapes::sphere(3));
    all.push_back(shapes::soup(700, 2));
  }
  Mesh flat = shapes::grid(8, 8);
  for (Vec3& p : flat.positions) p.z = 0;
  all.push_back(flat);
  return all;
}

class TraceOnDevice : public OnDevice {};

void expect_same_hits(const Mesh& mesh, float scale, size_t count) {
  const Mesh scaled = transformed(mesh, scale);
  const Bvh expected = Bvh::build(scaled.view());
  const Tree tree(scaled);
  const auto rays = adversarial_rays(scaled.view(), count, 3);
  const DeviceArray<Ray> given(rays);
  const DeviceArray<float> t(rays.size()), uvs(2 * rays.size());
  const DeviceArray<uint32_t> primitives(rays.size());
  const DeviceArray<uint8_t> any(rays.size());
  for (const bool cull_back : {false, true}) {
    with_scratch([&](void* scratch, size_t& bytes) {
      intersect_rays(scratch, bytes, tree.view(), rays_of(given, cull_back),
                     {t.data(), primitives.data(), uvs.data()});
    });
    with_scratch([&](void* scratch, size_t& bytes) {
      occluded_rays(scratch, bytes, tree.view(), rays_of(given, cull_back), any.data());
    });
    const auto ts = t.read(), uv = uvs.read();
    const auto ids = primitives.read();
    const auto results = any.read();
    RayOptions options;
    options.cull_back_faces = cull_back;
    for (size_t i = 0; i < rays.size(); ++i) {
      const Hit hit = expected.intersect(rays[i], options);
      ASSERT_EQ((Hit{ts[i], ids[i], uv[2 * i], uv[2 * i + 1]}), hit) << "ray " << i;
      ASSERT_EQ(results[i], hit.hit() ? 1 : 0);
    }
  }
}

TEST_F(TraceOnDevice, hits_are_those_of_the_processor) {
  for (const Mesh& mesh : meshes())
    for (const float scale : {1e-15f, 1.0f, 1e15f})
      expect_same_hits(mesh, scale, kEmulated ? 200 : 5000);
}

TEST_F(TraceOnDevice, masks_hide_triangles) {
  const Mesh mesh = shapes::soup(700, 2);
  std::vector<uint32_t> masks(mesh.triangles.size());
  for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1u << i % 3;
  const Bvh expected = Bvh::build(mesh.view(), {}, masks);
  const Tree tree(mesh);
  const auto rays = adversarial_rays(mesh.view(), kEmulated ? 200 : 1000, 3);
  const DeviceArray<Ray> given(rays);
  const DeviceArray<uint32_t> masks_there(masks), primitives(rays.size());
  for (const uint32_t mask : {0u, 2u, 6u}) {
    DeviceRays masked = rays_of(given);
    masked.mask = mask;
    masked.masks = masks_there.data();
    with_scratch([&](void* scratch, size_t& bytes) {
      intersect_rays(scratch, bytes, tree.view(), masked, {nullptr, primitives.data(), nullptr});
    });
    const auto ids = primitives.read();
    const RayOptions options{.mask = mask};
    for (size_t i = 0; i < rays.size(); ++i)
      ASSERT_EQ(ids[i], expected.intersect(rays[i], options).primitive) << "ray " << i;
  }
}

TEST_F(TraceOnDevice, hits_are_those_of_brute_force) {
  for (const Mesh& mesh : meshes()) {
    const Tree tree(mesh);
    const auto rays = adversarial_rays(mesh.view(), 280, 6);
    const DeviceArray<Ray> given(rays);
    const DeviceArray<float> t(rays.size());
    const DeviceArray<uint32_t> primitives(rays.size());
    with_scratch([&](void* scratch, size_t& bytes) {
      intersect_rays(scratch, bytes, tree.view(), rays_of(given),
                     {t.data(), primitives.data(), nullptr});
    });
    const auto ts = t.read();
    const auto ids = primitives.read();
    for (size_t i = 0; i < rays.size(); ++i)
      ASSERT_TRUE(umbel::testing::is_right(mesh.view(), rays[i],
                                           umbel::testing::trace_all(mesh.view(), rays[i]),
                                           {ts[i], ids[i], 0, 0}));
  }
}

std::vector<Vec3> points_around(const Mesh& mesh, size_t count) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> unit(-2, 2);
  std::vector<Vec3> points;
  for (size_t i = 0; i < count; ++i) points.push_back({unit(random), unit(random), unit(random)});
  for (size_t i = 0; i < count; i += 7)
    points[i] = mesh.positions[random() % mesh.positions.size()];
  return points;
}

void expect_same_closest_points(const Mesh& mesh, size_t number) {
  const Bvh expected = Bvh::build(mesh.view());
  const Tree tree(mesh);
  const auto points = points_around(mesh, number);
  const DeviceArray<Vec3> given(points), places(points.size());
  const DeviceArray<float> distances(points.size()), uvs(2 * points.size());
  const DeviceArray<uint32_t> primitives(points.size());
  with_scratch([&](void* scratch, size_t& bytes) {
    closest_points(scratch, bytes, tree.view(), {given.data(), 12, points.size()},
                   {&places.data()->x, distances.data(), primitives.data(), uvs.data()});
  });
  const auto p = places.read();
  const auto d = distances.read();
  const auto ids = primitives.read();
  for (size_t i = 0; i < points.size(); ++i) {
    const ClosestPoint e = expected.closest_point(points[i]);
    ASSERT_EQ(ids[i], e.primitive);
    ASSERT_EQ(d[i], e.distance);
    ASSERT_EQ(p[i], e.point);
  }
}

TEST_F(TraceOnDevice, closest_points_are_those_of_the_processor) {
  for (const Mesh& mesh : meshes()) expect_same_closest_points(mesh, kEmulated ? 150 : 2000);
}

void expect_same_overlaps(const Mesh& mesh, size_t number) {
  const Bvh expected = Bvh::build(mesh.view());
  const Tree tree(mesh);
  const auto points = points_around(mesh, number);
  std::vector<Aabb> boxes;
  for (const Vec3& p : points) {
    const Vec3 size = Vec3{0.1f, 0.2f, 0.05f} * float(1 + boxes.size() % 8);
    boxes.push_back({p - size, p + size});
  }
  const auto count = uint32_t(boxes.size());
  const DeviceArray<Aabb> given(boxes);
  const DeviceArray<uint32_t> offsets(count + 1);
  with_scratch([&](void* scratch, size_t& bytes) {
    count_overlaps(scratch, bytes, tree.view(), given.data(), count, offsets.data());
  });
  const uint32_t room = offsets.read().back();
  const DeviceArray<uint32_t> primitives(room);
  with_scratch([&](void* scratch, size_t& bytes) {
    list_overlaps(scratch, bytes, tree.view(), given.data(), count, offsets.data(),
                  primitives.data(), room);
  });
  const auto starts = offsets.read(), found = primitives.read();
  for (uint32_t i = 0; i < count; ++i)
    ASSERT_EQ(std::vector<uint32_t>(found.begin() + starts[i], found.begin() + starts[i + 1]),
              expected.overlaps(boxes[i]));
}

TEST_F(TraceOnDevice, overlaps_are_those_of_the_processor) {
  for (const Mesh& mesh : meshes()) expect_same_overlaps(mesh, kEmulated ? 60 : 300);
}

class AnySizeOfTraceOnDevice : public TraceOnDevice {};

TEST_F(AnySizeOfTraceOnDevice, answers) {
  const AnyMesh mesh(4000);
  SCOPED_TRACE(mesh);
  expect_same_hits(mesh, 1, any_size(600));
  expect_same_closest_points(mesh, any_size(300));
  expect_same_overlaps(mesh, any_size(100));
}

// What is wrong is said before any device is asked.

TEST(TraceInC, mistakes_are_named) {
  size_t bytes = 0;
  umbel_cuda_rays rays{};
  rays.origin_stride = 8;
  rays.direction_stride = 12;
  rays.interval_stride = 4;
  EXPECT_EQ(umbel_cuda_intersect(nullptr, &bytes, nullptr, &rays, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(umbel_last_error(), "origin_stride must be a multiple of 4 and at least 12, not 8");
  EXPECT_EQ(umbel_cuda_intersect(nullptr, &bytes, nullptr, nullptr, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  rays.origin_stride = 12;
  EXPECT_EQ(umbel_cuda_occluded(nullptr, nullptr, nullptr, &rays, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
}

}  // namespace
}  // namespace umbel::cuda
