#include "bvh/same_answers.hpp"
#include "kdtree/meshes.hpp"
#include "umbel/kdtree.hpp"

namespace umbel {
namespace {

using namespace testing;
using kdtree::KdTree;

TEST(KdTreeQueries, distances_and_overlaps_are_those_of_the_hierarchy) {
  for_hard_meshes([](const MeshView& mesh) {
    const Bvh bvh = Bvh::build(mesh);
    for (const bool compact : {false, true}) {
      kdtree::KdTreeConfig config;
      config.compact = compact;
      expect_same_shapes(KdTree::build(mesh, config), bvh, mesh, 150);
    }
  });
}

TEST(KdTreeQueries, of_meshes_of_extreme_size_and_far_from_the_origin) {
  const Mesh ball = shapes::blob(3, 2);
  for (const Mesh& mesh : {transformed(ball, 1e-12f), transformed(ball, 1e12f),
                           transformed(ball, 1, {1000, -3000, 500})})
    expect_same_shapes(KdTree::build(mesh.view()), Bvh::build(mesh.view()), mesh.view(), 300);
}

TEST(KdTreeQueries, without_triangles_there_is_nothing_near) {
  const KdTree empty;
  EXPECT_EQ(empty.closest_point({0, 0, 0}).primitive, kNone);
  EXPECT_FALSE(empty.contains({0, 0, 0}));
  EXPECT_TRUE(empty.overlaps(Sphere{{0, 0, 0}, 1}).empty());
  EXPECT_TRUE(empty.overlaps(Aabb{{-1, -1, -1}, {1, 1, 1}}).empty());
}

}  // namespace
}  // namespace umbel
