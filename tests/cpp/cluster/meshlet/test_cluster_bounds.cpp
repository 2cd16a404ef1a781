// Spheres contain their clusters, and what a cone culls cannot be seen, for meshes of any size.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/math.hpp"
#include "umbel/cluster.hpp"

namespace umbel {
namespace {

Clusters clusters_of(const Mesh& mesh, uint32_t max_items = 64) {
  ClusterConfig config = cluster_preset("quality", max_items);
  config.max_vertices = 128;
  return cluster_mesh(mesh.view(), config);
}

Mesh moved(Mesh mesh, float scale, float offset) {
  for (Vec3& p : mesh.positions)
    p = {p.x * scale + offset, p.y * scale - offset, p.z * scale + 2 * offset};
  return mesh;
}

// How far the eye is in front of the triangle's plane, against the size of what goes into that.
double height_above(const Mesh& mesh, uint32_t triangle, const Vec3d& eye) {
  const Triangle& t = mesh.triangles[triangle];
  const Vec3d a = to_double(mesh.positions[t[0]]);
  const Vec3d n = cross(to_double(mesh.positions[t[1]]) - a, to_double(mesh.positions[t[2]]) - a);
  const double size = length(n) * length(eye - a);
  return size > 0 ? dot(n, eye - a) / size : 0;
}

void expect_contains(const Mesh& mesh, const Clusters& clusters, size_t c, const Sphere& sphere) {
  const Range& r = clusters.ranges[c];
  for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
    for (const uint32_t v : mesh.triangles[clusters.items[i]])
      ASSERT_LE(length(to_double(mesh.positions[v]) - to_double(sphere.center)),
                double(sphere.radius));
}

// An eye in any direction, or one just inside the cone, where mistakes would show.
Vec3d eye_for(const ClusterBounds& b, int k, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double far = double(b.sphere.radius) * std::pow(10.0, k % 5 - 1);
  const Vec3d any{normal(random), normal(random), normal(random)}, axis = to_double(b.cone_axis);
  const double size = length(any), along = dot(any, axis);
  if (k % 2 || b.cone_cutoff == 1)
    return {b.sphere.center.x + far * any.x / size, b.sphere.center.y + far * any.y / size,
            b.sphere.center.z + far * any.z / size};
  const Vec3d across{any.x - along * axis.x, any.y - along * axis.y, any.z - along * axis.z};
  const double sine = double(b.cone_cutoff) + 1e-7, cosine = std::sqrt(1 - sine * sine);
  const double u = far * sine, v = far * cosine / length(across);
  return {b.cone_apex.x - u * axis.x - v * across.x, b.cone_apex.y - u * axis.y - v * across.y,
          b.cone_apex.z - u * axis.z - v * across.z};
}

void expect_culls_nothing_visible(const Mesh& mesh, const Clusters& clusters, size_t c,
                                  const ClusterBounds& b, std::mt19937& random, size_t& culled) {
  const Range& r = clusters.ranges[c];
  for (int k = 0; k < 40; ++k) {
    const Vec3d eye = eye_for(b, k, random);
    const Vec3d to_apex = to_double(b.cone_apex) - eye,
                to_center = to_double(b.sphere.center) - eye;
    const bool by_apex =
        dot(to_apex, to_double(b.cone_axis)) >= double(b.cone_cutoff) * length(to_apex);
    const bool by_sphere = dot(to_center, to_double(b.cone_axis)) >=
                           double(b.cone_cutoff) * length(to_center) + double(b.sphere.radius);
    if (!by_apex && !by_sphere) continue;
    ++culled;
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
      ASSERT_LE(height_above(mesh, clusters.items[i], eye), 1e-9)
          << "cluster " << c << ", triangle " << clusters.items[i];
  }
}

Mesh flattened(Mesh mesh, float height) {
  for (Vec3& p : mesh.positions) p.z *= height;
  return mesh;
}

TEST(ClusterBounds, spheres_contain_and_cones_cull_nothing_visible) {
  std::mt19937 random(1);
  for (const Mesh& shape :
       {shapes::blob(5, 1), shapes::terrain(60, 40, 2), shapes::grid(40, 40), shapes::torus(60, 30),
        shapes::soup(1000, 3), flattened(shapes::terrain(60, 40, 2), 2e-4f)}) {
    for (const auto& [scale, offset] :
         {std::pair{1.0f, 0.0f}, {1.0f, 3000.0f}, {1e-20f, 0.0f}, {1e18f, 0.0f}, {1e30f, 1e30f}}) {
      const Mesh mesh = moved(shape, scale, offset);
      const Clusters clusters = clusters_of(mesh);
      const std::vector<ClusterBounds> bounds = cluster_bounds(mesh.view(), clusters);
      ASSERT_EQ(bounds.size(), clusters.ranges.size());
      size_t culled = 0;
      for (size_t c = 0; c < bounds.size(); ++c) {
        expect_contains(mesh, clusters, c, bounds[c].sphere);
        expect_culls_nothing_visible(mesh, clusters, c, bounds[c], random, culled);
        if (HasFatalFailure()) FAIL() << "scale " << scale << ", offset " << offset;
      }
      if (shape.triangles.size() == 3200u) {
        EXPECT_GT(culled, 8 * bounds.size()) << "half of all eyes see a flat cluster's back";
      }
    }
  }
}

TEST(ClusterBounds, a_flat_cluster_has_a_flat_cone) {
  const Mesh mesh = shapes::grid(8, 8);
  for (const ClusterBounds& b : cluster_bounds(mesh.view(), clusters_of(mesh))) {
    EXPECT_NEAR(b.cone_axis.z, 1, 1e-6);
    EXPECT_LT(b.cone_cutoff, 1e-5f);
    EXPECT_NEAR(b.cone_apex.z, 0, 1e-6);
  }
}

TEST(ClusterBounds, cones_hold_triangles_that_are_tiny_beside_their_cluster) {
  for (const float size : {1e-6f, 1e-12f, 1e-18f, 1e-36f}) {
    Mesh mesh = shapes::grid(8, 8);
    const auto first = uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {{0, 0, 0}, {size, 0, size}, {0, size, 0}});
    mesh.triangles.push_back({first, first + 1, first + 2});
    const Clusters clusters = clusters_of(mesh, 256);
    ASSERT_EQ(clusters.ranges.size(), 1u);
    const ClusterBounds b = cluster_bounds(mesh.view(), clusters)[0];
    const Vec3d normal{-std::sqrt(0.5), 0, std::sqrt(0.5)};
    EXPECT_GE(b.cone_cutoff, length(cross(normal, to_double(b.cone_axis)))) << size;
    std::mt19937 random(1);
    size_t culled = 0;
    expect_culls_nothing_visible(mesh, clusters, 0, b, random, culled);
    EXPECT_GT(culled, 0u);
  }
}

TEST(ClusterBounds, a_closed_cluster_has_no_cone) {
  const Mesh mesh = shapes::tetrahedra(1);
  for (const ClusterBounds& b : cluster_bounds(mesh.view(), clusters_of(mesh))) {
    EXPECT_EQ(b.cone_axis, (Vec3{0, 0, 0}));
    EXPECT_EQ(b.cone_cutoff, 1.0f);
    EXPECT_GT(b.sphere.radius, 0.0f);
  }
}

TEST(ClusterBounds, triangles_without_area_have_a_sphere_and_no_cone) {
  Mesh mesh;
  mesh.positions = {{1, 2, 3}, {5, 2, 3}, {1, 2, 3}};
  mesh.triangles = {{0, 1, 2}, {0, 0, 0}};
  Clusters clusters;
  clusters.items = {0, 1};
  clusters.ranges = {{0, 1}, {1, 1}};
  const std::vector<ClusterBounds> bounds = cluster_bounds(mesh.view(), clusters);
  expect_contains(mesh, clusters, 0, bounds[0].sphere);
  EXPECT_NEAR(bounds[0].sphere.radius, 2, 1e-5);
  EXPECT_EQ(bounds[1].sphere, (Sphere{{1, 2, 3}, 0}));
  for (const ClusterBounds& b : bounds) EXPECT_EQ(b.cone_cutoff, 1.0f);
}

TEST(ClusterBounds, result_does_not_depend_on_threads) {
  const Mesh mesh = shapes::blob(6, 1);
  const Clusters clusters = clusters_of(mesh, 16);
  ASSERT_GT(clusters.ranges.size(), 4096u) << "more than one batch";
  const std::vector<ClusterBounds> all = cluster_bounds(mesh.view(), clusters);
  for (const uint32_t threads : {1u, 2u, 8u}) {
    BuildOptions options;
    options.threads = threads;
    EXPECT_EQ(cluster_bounds(mesh.view(), clusters, options), all);
  }
}

TEST(ClusterBounds, mistakes_are_errors) {
  Mesh mesh = shapes::grid(4, 4);
  const Clusters clusters = clusters_of(mesh);
  BuildOptions options;
  options.progress = [](float, std::string_view) { return false; };
  const auto code = [&](const Clusters& c, const BuildOptions& o = {}) {
    try {
      cluster_bounds(mesh.view(), c, o);
    } catch (const Error& error) {
      return error.code();
    }
    return ErrorCode::kIo;
  };
  EXPECT_EQ(code(clusters, options), ErrorCode::kCancelled);
  Clusters bad = clusters;
  bad.ranges[0].count = 1000;
  EXPECT_EQ(code(bad), ErrorCode::kInvalidArgument);
  mesh.positions[mesh.triangles[0][0]].x = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(code(clusters), ErrorCode::kInvalidMesh);
  mesh.triangles[0][0] = 9999;
  EXPECT_EQ(code(clusters), ErrorCode::kInvalidMesh);
}

}  // namespace
}  // namespace umbel
