// Whether two structures over the same triangles answer alike, bit by bit.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "bvh/oracle.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::testing {

inline void expect_same_rays(const TriangleQueries& a, const TriangleQueries& b,
                             std::span<const Ray> rays) {
  std::vector<Hit> first(1000), second(1000);
  for (size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    const Hit hit = b.intersect(ray);
    ASSERT_EQ(a.intersect(ray), hit) << "ray " << i;
    ASSERT_EQ(a.intersect(ray, {.cull_back_faces = true}),
              b.intersect(ray, {.cull_back_faces = true}))
        << "ray " << i;
    ASSERT_EQ(a.occluded(ray), hit.hit()) << "ray " << i;
    for (const size_t room : {size_t{3}, size_t{1000}}) {
      const size_t count = b.all_hits(ray, std::span(second).first(room));
      ASSERT_EQ(a.all_hits(ray, std::span(first).first(room)), count) << "ray " << i;
      ASSERT_TRUE(std::equal(first.begin(), first.begin() + std::ptrdiff_t(count), second.begin()))
          << "ray " << i;
    }
  }
}

/// Points in and around the mesh, and its own vertices.
inline std::vector<Vec3> points_about(const MeshView& mesh, size_t count) {
  std::vector<Vec3> points;
  const Aabb box = bounds(mesh);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> share(-0.25f, 1.25f);
  const auto between = [&](float low, float high) { return low + (high - low) * share(random); };
  for (size_t i = 0; i < count; ++i)
    points.push_back(i % 4 == 3 && !mesh.positions.empty()
                         ? mesh.positions[random() % mesh.positions.size()]
                         : Vec3{between(box.min.x, box.max.x), between(box.min.y, box.max.y),
                                between(box.min.z, box.max.z)});
  return points;
}

inline bool same_point(const ClosestPoint& a, const ClosestPoint& b) {
  return a.point == b.point && a.distance == b.distance && a.primitive == b.primitive &&
         a.u == b.u && a.v == b.v;
}

/// Triangles near a frustum's edges may or may not be found; those with a corner in it must be.
inline void expect_sound_overlaps(const std::vector<uint32_t>& found,
                                  const std::vector<uint32_t>& by_triangles_alone,
                                  const Frustum& frustum, const MeshView& mesh) {
  ASSERT_TRUE(std::includes(by_triangles_alone.begin(), by_triangles_alone.end(), found.begin(),
                            found.end()));
  const auto is_within = [&](uint32_t vertex) {
    const Vec3d p = to_double(mesh.positions[vertex]);
    return std::all_of(frustum.begin(), frustum.end(), [&](const Plane& plane) {
      return dot(to_double(plane.normal), p) + double(plane.offset) >= 0;
    });
  };
  for (const uint32_t t : by_triangles_alone)
    if (std::any_of(mesh.triangles[t].begin(), mesh.triangles[t].end(), is_within)) {
      ASSERT_TRUE(std::binary_search(found.begin(), found.end(), t)) << "triangle " << t;
    }
}

inline void expect_same_shapes(const TriangleQueries& a, const TriangleQueries& b,
                               const MeshView& mesh, size_t count) {
  const std::vector<Vec3> points = points_about(mesh, count);
  const Aabb box = bounds(mesh);
  const float size =
      std::max({box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z, 0.0f});
  std::vector<ClosestPoint> closest(points.size());
  std::vector<uint8_t> inside(points.size());
  std::vector<float> distances(points.size());
  a.closest_point(points, closest);
  a.contains(points, inside);
  a.signed_distance(points, distances, 2);
  for (size_t i = 0; i < points.size(); ++i) {
    const Vec3& p = points[i];
    const ClosestPoint expected = b.closest_point(p);
    ASSERT_TRUE(same_point(a.closest_point(p), expected)) << "point " << i;
    ASSERT_TRUE(same_point(closest[i], expected)) << "point " << i;
    const float limit = expected.distance * (i % 2 ? 0.99f : 1.01f);
    ASSERT_TRUE(same_point(a.closest_point(p, limit), b.closest_point(p, limit))) << "point " << i;
    ASSERT_EQ(a.contains(p), b.contains(p)) << "point " << i;
    ASSERT_EQ(inside[i] != 0, b.contains(p)) << "point " << i;
    ASSERT_EQ(distances[i], b.signed_distance(p)) << "point " << i;
    const float reach = size * float(i % 7) / 20;
    const Aabb region{{p.x - reach, p.y - reach / 2, p.z - reach}, {p.x + reach, p.y, p.z}};
    ASSERT_EQ(a.overlaps(region), b.overlaps(region)) << "point " << i;
    ASSERT_EQ(a.overlaps(Sphere{p, reach}), b.overlaps(Sphere{p, reach})) << "point " << i;
    const Frustum frustum{Plane{{1, 0, 0}, -p.x},    {{0, 1, 0}, -p.y},
                          {{0, 0, 1}, -p.z},         {{-1, 0, 0}, p.x + reach},
                          {{0, -1, 0}, p.y + reach}, {{0, 0.6f, -0.8f}, p.z + reach}};
    expect_sound_overlaps(a.overlaps(frustum), b.overlaps(frustum), frustum, mesh);
  }
}

}  // namespace umbel::testing
