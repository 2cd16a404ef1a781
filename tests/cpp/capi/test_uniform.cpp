// Uniform structures, kd-trees over boxes and collisions from C, beside the C++ interface.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "capi/bvh_call.hpp"
#include "umbel/collision.hpp"
#include "umbel/kdtree_traverse.hpp"
#include "umbel/umbel_uniform.h"
#include "umbel/uniform.hpp"

namespace umbel {
namespace {

using namespace bvh_call;

struct FreeUniform {
  void operator()(umbel_uniform* structure) const { umbel_uniform_free(structure); }
};
struct FreeBoxes {
  void operator()(umbel_box_kdtree* tree) const { umbel_box_kdtree_free(tree); }
};

std::vector<Ray> rays_through(const Mesh& mesh) {
  std::vector<Ray> rays;
  for (const Vec3& p : mesh.positions) rays.push_back({{3, 2, -4}, 0, {p.x - 3, p.y - 2, p.z + 4}});
  return rays;
}

TEST(CapiUniform, every_structure_answers_as_in_cpp) {
  Call call;
  const Bvh bvh = Bvh::build(call.source.view());
  const std::vector<Ray> rays = rays_through(call.source);
  for (const auto kind : {UMBEL_UNIFORM_GRID, UMBEL_UNIFORM_OCTREE, UMBEL_UNIFORM_INTERVALS}) {
    umbel_uniform_config config;
    umbel_uniform_config_init(&config);
    config.structure = kind;
    umbel_uniform* made = nullptr;
    ASSERT_EQ(umbel_uniform_build(&call.mesh, &config, &call.options, &made), UMBEL_OK)
        << umbel_last_error();
    const std::unique_ptr<umbel_uniform, FreeUniform> owned(made);
    std::vector<Hit> hits(rays.size());
    ASSERT_EQ(
        umbel_uniform_intersect(made, reinterpret_cast<const umbel_ray*>(rays.data()), rays.size(),
                                nullptr, reinterpret_cast<umbel_hit*>(hits.data())),
        UMBEL_OK);
    for (size_t i = 0; i < rays.size(); ++i) ASSERT_EQ(hits[i], bvh.intersect(rays[i]));
    const umbel_vec3 point{0.1f, 0.2f, 0.3f};
    uint8_t inside = 7;
    EXPECT_EQ(umbel_uniform_contains(made, &point, 1, 0, &inside), UMBEL_OK);
    EXPECT_EQ(inside, bvh.contains({0.1f, 0.2f, 0.3f}));
    const umbel_sphere ball{{1, 0, 0}, 0.3f};
    size_t count = 0;
    EXPECT_EQ(umbel_uniform_overlaps_sphere(made, &ball, nullptr, 0, &count), UMBEL_OK);
    EXPECT_EQ(count, bvh.overlaps(Sphere{{1, 0, 0}, 0.3f}).size());
    umbel_kdtree_statistics found;
    umbel_kdtree_statistics_init(&found);
    EXPECT_EQ(umbel_uniform_get_statistics(made, &found), UMBEL_OK);
    EXPECT_EQ(found.triangle_count, call.source.triangles.size());
    EXPECT_GT(found.sah_cost, 0);
  }
}

TEST(CapiUniform, mistakes_are_told) {
  Call call;
  umbel_uniform_config config;
  umbel_uniform_config_init(&config);
  umbel_uniform* made = nullptr;
  config.structure = 3;
  EXPECT_EQ(umbel_uniform_build(&call.mesh, &config, nullptr, &made), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(made, nullptr);
  config.structure = UMBEL_UNIFORM_OCTREE;
  config.max_depth = 21;
  EXPECT_EQ(umbel_uniform_build(&call.mesh, &config, nullptr, &made), UMBEL_ERROR_INVALID_ARGUMENT);
  for (const auto kind : {UMBEL_UNIFORM_GRID, UMBEL_UNIFORM_OCTREE, UMBEL_UNIFORM_INTERVALS})
    for (const float cost : {0.0f, -1.0f, kNan, INFINITY}) {
      umbel_uniform_config_init(&config);
      config.structure = kind;
      config.traversal_cost = cost;
      expect_failure(umbel_uniform_build(&call.mesh, &config, nullptr, &made),
                     UMBEL_ERROR_INVALID_ARGUMENT, "cost.traversal");
      config.traversal_cost = 1;
      config.intersection_cost = cost;
      expect_failure(umbel_uniform_build(&call.mesh, &config, nullptr, &made),
                     UMBEL_ERROR_INVALID_ARGUMENT, "cost.intersection");
    }
  EXPECT_EQ(umbel_uniform_build(&call.mesh, nullptr, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_uniform_intersect(nullptr, nullptr, 0, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_uniform_free(nullptr);
}

float visit_boxes(void* user, const uint32_t* primitives, size_t count) {
  auto& seen = *static_cast<std::vector<uint8_t>*>(user);
  for (size_t i = 0; i < count; ++i) seen[primitives[i]] = 1;
  return seen[0] ? -1.0f : INFINITY;
}

TEST(CapiBoxKdTree, visits_the_boxes_that_a_ray_meets) {
  std::vector<umbel_aabb> boxes;
  for (int i = 0; i < 200; ++i) {
    const float x = float(i), y = float(i % 7);
    boxes.push_back({{x, y, 0}, {x + 0.5f, y + 0.5f, 1}});
  }
  umbel_kdtree_config config;
  umbel_kdtree_config_init(&config);
  EXPECT_EQ(config.target_leaf_size, 0u);
  umbel_box_kdtree* made = nullptr;
  ASSERT_EQ(umbel_box_kdtree_build(boxes.data(), boxes.size(), &config, nullptr, &made), UMBEL_OK);
  const std::unique_ptr<umbel_box_kdtree, FreeBoxes> owned(made);
  const umbel_ray ray{{500, 3.25f, 0.5f}, 0, {-1, 0, 0}, INFINITY};
  std::vector<uint8_t> seen(boxes.size());
  float limit = 0;
  ASSERT_EQ(umbel_box_kdtree_traverse(made, &ray, visit_boxes, &seen, &limit), UMBEL_OK);
  for (size_t i = 3; i < boxes.size(); i += 7) EXPECT_TRUE(seen[i]);
  const umbel_aabb region{{10, 0, 0}, {13, 9, 1}};
  size_t count = 0;
  ASSERT_EQ(umbel_box_kdtree_overlaps_box(made, &region, nullptr, 0, &count), UMBEL_OK);
  EXPECT_EQ(count, 4u);
  umbel_kdtree_statistics found;
  umbel_kdtree_statistics_init(&found);
  EXPECT_EQ(umbel_box_kdtree_get_statistics(made, &found), UMBEL_OK);
  EXPECT_EQ(found.triangle_count, boxes.size());
  EXPECT_EQ(umbel_box_kdtree_traverse(made, &ray, nullptr, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  boxes[3].min.x = kNan;
  EXPECT_EQ(umbel_box_kdtree_build(boxes.data(), boxes.size(), nullptr, nullptr, &made),
            UMBEL_ERROR_INVALID_MESH);
  EXPECT_EQ(made, nullptr);
}

TEST(CapiCollide, pairs_are_those_of_cpp) {
  Call first, second(shapes::torus(16, 8));
  ASSERT_EQ(first.build(), UMBEL_OK);
  ASSERT_EQ(second.build(), UMBEL_OK);
  const umbel_bvh *a = first.bvh.get(), *b = second.bvh.get();
  const double rows[12] = {1, 0, 0, 0.25, 0, 1, 0, 0, 0, 0, 1, 0.5};
  CollisionOptions options;
  std::copy_n(rows, 12, options.second_to_first.begin());
  const auto truth =
      collide(Bvh::build(first.source.view()), Bvh::build(second.source.view()), options);
  size_t count = 0;
  ASSERT_EQ(umbel_bvh_collide(a, b, rows, 0, nullptr, 0, &count), UMBEL_OK);
  ASSERT_EQ(count, truth.size());
  ASSERT_GT(count, 0u);
  std::vector<umbel_triangle_pair> pairs(count);
  EXPECT_EQ(umbel_bvh_collide(a, b, rows, 0, pairs.data(), 1, &count), UMBEL_ERROR_CAPACITY);
  ASSERT_EQ(umbel_bvh_collide(a, b, rows, 0, pairs.data(), count, &count), UMBEL_OK);
  for (size_t i = 0; i < count; ++i) {
    EXPECT_EQ(pairs[i].first, truth[i].first);
    EXPECT_EQ(pairs[i].second, truth[i].second);
  }
  uint8_t does = 0;
  EXPECT_EQ(umbel_bvh_collides(a, b, nullptr, 0, &does), UMBEL_OK);
  EXPECT_EQ(does, 1);
  EXPECT_EQ(umbel_bvh_collides(a, nullptr, nullptr, 0, &does), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_bvh_collide(a, b, nullptr, 0, nullptr, 0, nullptr), UMBEL_ERROR_INVALID_ARGUMENT);
}

}  // namespace
}  // namespace umbel
