#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/math.hpp"
#include "bvh/oracle.hpp"
#include "bvh/two_level/two_level_bvh.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::bvh {
namespace {

constexpr Transform kIdentity{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
/// Rotated, stretched, mirrored and moved.
constexpr Transform kMoved{{0, -0.5f, 0, 3.2f, 0.7f, 0, 0, -0.4f, 0, 0, -0.3f, 0.5f}};

/// A mesh in clusters of as many triangles as follow each other.
std::vector<BottomTree> clusters_of(const Mesh& mesh, uint32_t size, uint32_t mask = 1) {
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  std::vector<BottomTree> clusters;
  const auto count = static_cast<uint32_t>(boxes.size());
  for (uint32_t first = 0; first < count; first += size) {
    const uint32_t own = std::min(size, count - first);
    clusters.push_back({{first, own}, mask, build(std::span(boxes).subspan(first, own))});
  }
  return clusters;
}

std::vector<ClusterInstance> instances_of(size_t clusters, uint32_t transform,
                                          uint32_t ray_kinds = kPrimaryRays | kSecondaryRays) {
  std::vector<ClusterInstance> instances;
  for (uint32_t c = 0; c < clusters; ++c) instances.push_back({c, transform, ray_kinds});
  return instances;
}

std::vector<Ray> random_rays(uint32_t count) {
  std::mt19937 random(3);
  const auto next = [&] { return float(random() >> 8) * 0x1p-23f - 1; };
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    ray.origin = {2 * next() + 1.5f, 2 * next(), 2 * next()};
    ray.direction = {next(), next(), next()};
  }
  rays[0].direction = {1e-30f, 2e-30f, -1e-30f};
  rays[1].direction = {0, 0, 1e25f};
  return rays;
}

TEST(TwoLevelBvh, instances_are_hit_where_the_transformed_mesh_is) {
  const Mesh mesh = shapes::blob(4, 3);
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  std::vector<BottomTree> clusters = clusters_of(mesh, 70);
  const size_t parts = clusters.size();
  std::vector<ClusterInstance> instances = instances_of(parts, 0);
  const std::vector<ClusterInstance> moved = instances_of(parts, 1);
  instances.insert(instances.end(), moved.begin(), moved.end());
  const InstanceTransform transform(kMoved);
  const TwoLevelBvh two_levels(std::move(clusters), instances,
                               {InstanceTransform(kIdentity), transform}, mesh.positions,
                               mesh.triangles);
  EXPECT_EQ(two_levels.instanced_triangles(), 2 * uint64_t{count});

  Mesh both = mesh;
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const Vec3& p : mesh.positions) both.positions.push_back(transform.point_to_world(p));
  for (const Triangle& t : mesh.triangles)
    both.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  const Bvh flat = Bvh::build(both.view());
  for (const Vec3& p : both.positions) {
    const Aabb bounds = two_levels.bounds();
    EXPECT_TRUE(min(bounds.min, p) == bounds.min && max(bounds.max, p) == bounds.max);
  }
  uint32_t hits[2] = {};
  for (const Ray& ray : random_rays(2000)) {
    const Hit expected = flat.intersect(ray);
    const InstanceHit hit = two_levels.intersect(ray, {}, kPrimaryRays);
    ASSERT_EQ(hit.hit(), expected.hit());
    EXPECT_EQ(two_levels.occluded(ray, {}, kSecondaryRays), expected.hit());
    if (!hit.hit()) continue;
    ++hits[hit.transform];
    ASSERT_NEAR(hit.t, expected.t, 1e-4f * std::max(expected.t, 1.0f));
    Ray shorter = ray;
    shorter.t_max = hit.t * 0.99f;
    EXPECT_EQ(two_levels.occluded(shorter, {}, kPrimaryRays), flat.occluded(shorter));
  }
  EXPECT_GT(hits[0], 100u);
  EXPECT_GT(hits[1], 20u);
}

TEST(TwoLevelBvh, rays_meet_the_instances_of_their_kind_and_mask) {
  const Mesh mesh = shapes::sphere(2);
  std::vector<BottomTree> clusters = clusters_of(mesh, 1000, 1);
  ASSERT_EQ(clusters.size(), 1u);
  clusters.push_back(clusters[0]);
  clusters[1].mask = 2;
  Transform far = kIdentity;
  far.rows[3] = 10;
  const TwoLevelBvh bvh(std::move(clusters),
                        std::vector<ClusterInstance>{{0, 0, kPrimaryRays}, {1, 1, kSecondaryRays}},
                        {InstanceTransform(kIdentity), InstanceTransform(far)}, mesh.positions,
                        mesh.triangles);
  const Ray near{{0, 0, -5}, 0, {0, 0, 1}}, away{{10, 0, -5}, 0, {0, 0, 1}};
  EXPECT_TRUE(bvh.occluded(near, {}, kPrimaryRays));
  EXPECT_FALSE(bvh.occluded(near, {}, kSecondaryRays));
  EXPECT_FALSE(bvh.occluded(away, {}, kPrimaryRays));
  EXPECT_TRUE(bvh.occluded(away, {}, kSecondaryRays));
  EXPECT_FALSE(bvh.occluded(near, {.mask = 2}, kPrimaryRays));
  EXPECT_TRUE(bvh.occluded(away, {.mask = 2}, kSecondaryRays));
  EXPECT_EQ(bvh.instanced_triangles(), mesh.triangles.size());
}

TEST(TwoLevelBvh, transforms_have_inverses_and_those_without_are_refused) {
  const InstanceTransform transform(kMoved);
  const Vec3 p{0.3f, -2, 5};
  EXPECT_LT(length(transform.point_to_object(transform.point_to_world(p)) - p), 1e-5f);
  EXPECT_GE(transform.scale(), 0.7f);
  const Aabb box = transform.box_to_world({{0, 0, 0}, {1, 2, 3}});
  const Vec3 corner = transform.point_to_world({1, 0, 3});
  EXPECT_TRUE(max(box.max, corner) == box.max && min(box.min, corner) == box.min);
  EXPECT_THROW(InstanceTransform(Transform{{1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 1, 0}}), Error);
}

TEST(TwoLevelBvh, parts_of_extreme_size_are_hit_where_their_transform_puts_them) {
  const Mesh mesh = shapes::blob(3, 3);
  const auto with_parts_of_size = [&](int exponent) {
    Mesh part = mesh;
    for (Vec3& p : part.positions) p = p * std::ldexp(1.0f, exponent);
    const float back = std::ldexp(1.0f, -exponent);
    const InstanceTransform transform(Transform{{back, 0, 0, 0, 0, back, 0, 0, 0, 0, back, 0}});
    std::vector<BottomTree> clusters = clusters_of(part, 70);
    const std::vector<ClusterInstance> instances = instances_of(clusters.size(), 0);
    EXPECT_NEAR(transform.scale() / back, std::sqrt(3), 1e-6);
    return TwoLevelBvh(std::move(clusters), instances, {transform}, part.positions, part.triangles);
  };
  const TwoLevelBvh expected = with_parts_of_size(0);
  for (const int exponent : {-100, -60, -40, 40, 60, 100}) {
    const TwoLevelBvh bvh = with_parts_of_size(exponent);
    EXPECT_EQ(bvh.bounds(), expected.bounds());
    for (const Ray& ray : random_rays(200)) {
      const InstanceHit hit = bvh.intersect(ray, {}, kPrimaryRays);
      ASSERT_EQ(hit, expected.intersect(ray, {}, kPrimaryRays)) << exponent;
      ASSERT_EQ(bvh.occluded(ray, {}, kPrimaryRays), hit.hit());
    }
  }
}

/// A plane whose transform brings it back from far away: coordinates are rounded there.
TEST(TwoLevelBvh, there_is_no_gap_between_clusters_that_come_from_far_away) {
  constexpr uint32_t kSide = 33;
  constexpr float kFar = 1e6f;
  Mesh mesh;
  for (uint32_t i = 0; i < kSide * kSide; ++i)
    mesh.positions.push_back({kFar + float(i % kSide), kFar + float(i / kSide), kFar});
  for (uint32_t i = 0; i + kSide < kSide * kSide; ++i) {
    if (i % kSide + 1 == kSide) continue;
    mesh.triangles.push_back({i, i + 1, i + kSide});
    mesh.triangles.push_back({i + 1, i + kSide + 1, i + kSide});
  }
  const InstanceTransform transform(Transform{{1, 0, 0, -kFar, 0, 1, 0, -kFar, 0, 0, 1, -kFar}});
  std::vector<BottomTree> clusters = clusters_of(mesh, 32);
  const std::vector<ClusterInstance> instances = instances_of(clusters.size(), 0);
  const TwoLevelBvh bvh(std::move(clusters), instances, {transform}, mesh.positions,
                        mesh.triangles);
  std::mt19937 random(1);
  for (uint32_t i = 0; i < 20000; ++i) {
    const auto next = [&] { return 1 + 0x1p-32f * float(random()) * (kSide - 3); };
    const Vec3 origin{next(), next(), 2};
    ASSERT_TRUE(bvh.occluded({origin, 0, {0.01f, 0.02f, -1}}, {}, kPrimaryRays)) << i;
  }
}

TEST(TwoLevelBvh, what_lies_at_a_t_that_overflows_is_missed) {
  const Mesh mesh = shapes::sphere(2);
  std::vector<BottomTree> clusters = clusters_of(mesh, 20);
  const std::vector<ClusterInstance> instances = instances_of(clusters.size(), 0);
  const std::vector<InstanceTransform> transforms{InstanceTransform(kIdentity)};
  const TwoLevelBvh bvh(std::move(clusters), instances, transforms, mesh.positions, mesh.triangles);
  for (const Ray& ray : umbel::testing::rays_whose_t_overflows()) {
    EXPECT_FALSE(bvh.intersect(ray, {}, kPrimaryRays).hit());
    EXPECT_FALSE(bvh.occluded(ray, {}, kPrimaryRays));
  }
}

TEST(TwoLevelBvh, nothing_is_hit_without_instances) {
  const TwoLevelBvh empty({}, {}, {}, {}, {});
  EXPECT_FALSE(empty.intersect({{0, 0, 0}, 0, {0, 0, 1}}, {}, kPrimaryRays).hit());
  EXPECT_EQ(empty.bounds(), Aabb{});
}

}  // namespace
}  // namespace umbel::bvh
