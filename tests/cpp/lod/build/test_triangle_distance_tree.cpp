// lod::TriangleDistanceTree: distances as a hierarchy over the same triangles gives them.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/math.hpp"
#include "lod/build/clusterise.hpp"
#include "lod/build/triangle_distance_tree.hpp"
#include "lod/dag/source.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::lod {
namespace {

using testing::Random;

struct Scene {
  Source source;
  ClusterSet clusters;
  TriangleDistanceTree surface;
  Bvh bvh;

  explicit Scene(const Mesh& mesh) : bvh(Bvh::build(mesh.view())) {
    Config config;
    source = make_source(mesh.view(), {});
    std::vector<Sphere> spheres;
    clusterise_source(source, config, clusters, spheres);
    surface.build(clusters, source.mesh.positions, 1.0f);
  }
};

Vec3 random_point(const Aabb& box, Random& random) {
  const auto at = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(1.4 * random.uniform() - 0.2);
  };
  return {at(box.min.x, box.max.x), at(box.min.y, box.max.y), at(box.min.z, box.max.z)};
}

class TriangleDistanceTreeOf : public ::testing::TestWithParam<int> {
 public:
  static Mesh shape() {
    switch (GetParam()) {
      case 0:
        return shapes::blob(5, 3);
      case 1:
        return shapes::soup(3000, 5);
      case 2:
        return shapes::terrain(40, 40, 2);
      default:
        return shapes::tetrahedra(1);
    }
  }

  const Mesh mesh = shape();
  const Scene scene{mesh};
  const Aabb box = bounds(mesh.view());
  const float size = length(box.max - box.min);
};

TEST_P(TriangleDistanceTreeOf, finds_the_distance_whatever_the_hint) {
  Random random(3);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p = random_point(box, random);
    const uint32_t hint = static_cast<uint32_t>(random.uniform() * 2000);
    const TriangleDistanceTree::Nearest found = scene.surface.nearest(p, 0.0f, hint);
    EXPECT_NEAR(std::sqrt(found.squared), scene.bvh.closest_point(p).distance, 1e-5f * size);
    EXPECT_LT(found.cluster, scene.clusters.size());
  }
}

TEST_P(TriangleDistanceTreeOf, what_is_near_enough_is_no_nearer_than_the_nearest) {
  Random random(4);
  for (int i = 0; i < 500; ++i) {
    const Vec3 p = random_point(box, random);
    const float enough = 0.3f * size * static_cast<float>(random.uniform());
    const float found = std::sqrt(scene.surface.nearest(p, enough * enough).squared);
    const float nearest = scene.bvh.closest_point(p).distance;
    EXPECT_GE(found, nearest - 1e-5f * size);
    EXPECT_LE(found, std::max(enough, nearest) + 1e-5f * size);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, TriangleDistanceTreeOf, ::testing::Range(0, 4));

TEST(TriangleDistanceTree, degenerate_triangles_are_points_and_segments) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {5, 5, 5}};
  mesh.triangles = {{0, 1, 2}, {3, 3, 3}};
  const Scene scene(mesh);
  EXPECT_FLOAT_EQ(scene.surface.nearest({1.5f, 2, 0}, 0.0f).squared, 4.0f);
  EXPECT_FLOAT_EQ(scene.surface.nearest({5, 5, 6}, 0.0f).squared, 1.0f);
}

TEST(TriangleDistanceTree, clusters_smaller_than_any_cell_are_found) {
  for (const float size : {1e-44f, 1e-39f, 1e-20f}) {
    Mesh mesh = shapes::sphere(2);
    for (Vec3& p : mesh.positions) p = p * size + Vec3{0, 0, size < 1e-30f ? 0.0f : 1.0f};
    mesh.positions.insert(mesh.positions.end(), {{1, 0, 0}, {1, 1, 0}, {1, 0, 1}});
    const auto last = static_cast<uint32_t>(mesh.positions.size());
    mesh.triangles.push_back({last - 3, last - 2, last - 1});
    const Scene scene(mesh);
    EXPECT_FLOAT_EQ(scene.surface.nearest({2, 0, 0}, 0.0f).squared, 1.0f);
    EXPECT_LE(scene.surface.nearest(mesh.positions[0], 0.0f).squared, 4 * size * size);
  }
}

TEST(TriangleDistanceTree, rounding_far_from_the_origin_loses_nothing) {
  Mesh mesh = shapes::sphere(2);
  for (Vec3& p : mesh.positions) p = p * 4.0f + Vec3{1e7f, -1e7f, 1e7f};
  const Scene scene(mesh);
  for (const Vec3& p : mesh.positions) EXPECT_EQ(scene.surface.nearest(p, 0.0f).squared, 0.0f);
}

TEST(TriangleDistanceTree, nothing_is_infinitely_far) {
  TriangleDistanceTree surface;
  surface.build(ClusterSet(), {}, 1.0f);
  EXPECT_EQ(surface.nearest({0, 0, 0}, 0.0f).squared, kInfinity);
}

}  // namespace
}  // namespace umbel::lod
