// Binary trees from C: the same as from C++, in arrays of the caller.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "capi/bvh_call.hpp"

namespace umbel {
namespace {

using namespace bvh_call;

TEST(CapiBvh2, trees_fit_what_was_required_and_are_those_of_cpp) {
  for (const bvh::Builder builder : bvh::builders()) {
    Call call;
    call.config.builder = uint32_t(builder);
    Tree made(call.mesh.triangle_count, &call.config);
    ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, &call.config, &call.options, &made.tree),
              UMBEL_OK)
        << umbel_last_error();
    bvh::Config config;
    config.builder = builder;
    const bvh::Bvh2 expected = bvh::build(call.source.view(), config);
    ASSERT_EQ(made.tree.node_count, expected.nodes.size());
    ASSERT_EQ(made.tree.primitive_count, expected.primitives.size());
    EXPECT_EQ(std::memcmp(made.nodes.data(), expected.nodes.data(),
                          expected.nodes.size() * sizeof(bvh::Node)),
              0);
    EXPECT_TRUE(std::equal(expected.primitives.begin(), expected.primitives.end(),
                           made.primitives.begin()));
  }
}

TEST(CapiBvh2, boxes_give_the_tree_of_their_triangles) {
  const Call call;
  const std::vector<Aabb> boxes = triangle_boxes(call.source.view());
  Tree over_boxes(boxes.size()), over_triangles(boxes.size());
  ASSERT_EQ(umbel_bvh2_build(reinterpret_cast<const umbel_aabb*>(boxes.data()), boxes.size(),
                             &call.config, nullptr, &over_boxes.tree),
            UMBEL_OK)
      << umbel_last_error();
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, &call.config, nullptr, &over_triangles.tree),
            UMBEL_OK);
  EXPECT_EQ(over_boxes.primitives, over_triangles.primitives);
  EXPECT_EQ(over_boxes.tree.node_count, over_triangles.tree.node_count);
}

TEST(CapiBvh2, statistics_are_those_of_cpp_at_the_config_s_costs) {
  Call call;
  Tree made(call.mesh.triangle_count);
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &made.tree), UMBEL_OK);
  umbel_bvh2_statistics found;
  umbel_bvh2_statistics_init(&found);
  ASSERT_EQ(umbel_bvh2_get_statistics(&made.tree, nullptr, &found), UMBEL_OK) << umbel_last_error();
  const bvh::Bvh2 tree = bvh::build(call.source.view());
  const bvh::Statistics truth = bvh::statistics(tree);
  EXPECT_EQ(found.nodes, truth.nodes);
  EXPECT_EQ(found.leaves, truth.leaves);
  EXPECT_EQ(found.max_depth, truth.max_depth);
  EXPECT_EQ(found.references, truth.references);
  EXPECT_EQ(found.sah_cost, truth.sah_cost);
  call.config.traversal_cost = 1, call.config.intersection_cost = 7;
  ASSERT_EQ(umbel_bvh2_get_statistics(&made.tree, &call.config, &found), UMBEL_OK);
  EXPECT_EQ(found.sah_cost, bvh::sah_cost(tree, {1, 7}));
}

TEST(CapiBvh2, a_tree_becomes_a_hierarchy) {
  Call call;
  Tree made(call.mesh.triangle_count);
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &made.tree), UMBEL_OK);
  umbel_bvh* bvh = nullptr;
  ASSERT_EQ(umbel_bvh_from_bvh2(&made.tree, &call.mesh, nullptr, nullptr, &bvh), UMBEL_OK)
      << umbel_last_error();
  const Owned owned(bvh);
  ASSERT_EQ(call.build(), UMBEL_OK);
  const std::vector<Ray> rays = random_rays(200, 12);
  std::vector<umbel_hit> a(rays.size()), b(rays.size());
  umbel_bvh_intersect(bvh, as_c(rays), rays.size(), nullptr, a.data());
  umbel_bvh_intersect(call.bvh.get(), as_c(rays), rays.size(), nullptr, b.data());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]), 0);
}

TEST(CapiBvh2, no_boxes_make_an_empty_tree) {
  Tree made(0);
  EXPECT_EQ(made.needed.nodes, 0u);
  ASSERT_EQ(umbel_bvh2_build(nullptr, 0, nullptr, nullptr, &made.tree), UMBEL_OK)
      << umbel_last_error();
  EXPECT_EQ(made.tree.node_count, 0u);
  umbel_bvh2_statistics found;
  umbel_bvh2_statistics_init(&found);
  ASSERT_EQ(umbel_bvh2_get_statistics(&made.tree, nullptr, &found), UMBEL_OK);
  EXPECT_EQ(found.sah_cost, 0);
}

TEST(CapiBvh2, arrays_that_are_too_small_are_left_alone_and_say_what_they_need) {
  Call call;
  for (const bool few_nodes : {true, false}) {
    Tree made(call.mesh.triangle_count);
    if (few_nodes)
      made.tree.node_capacity = 3;
    else
      made.tree.primitive_capacity = 3;
    expect_failure(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &made.tree),
                   UMBEL_ERROR_CAPACITY, "tree has room for");
    made.expect_untouched();
    EXPECT_GT(made.tree.node_count, 3u);
    EXPECT_EQ(made.tree.primitive_count, call.mesh.triangle_count);
    made.tree.node_capacity = made.tree.node_count;
    made.tree.primitive_capacity = made.tree.primitive_count;
    EXPECT_EQ(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &made.tree), UMBEL_OK);
  }
}

TEST(CapiBvh2, what_no_build_takes_requires_nothing) {
  umbel_bvh2_capacity room;
  umbel_bvh2_capacity_init(&room);
  const auto refused = [&](auto change, const char* named) {
    umbel_bvh_config config;
    umbel_bvh_config_init(&config);
    change(config);
    expect_failure(umbel_bvh2_requirements(1000, &config, &room), UMBEL_ERROR_INVALID_ARGUMENT,
                   named);
    EXPECT_EQ(room.nodes, 0u);
  };
  refused([](auto& c) { c.builder = 77; }, "builder is 77");
  refused([](auto& c) { c.spatial_budget = 5; }, "spatial_budget is 5");
  refused([](auto& c) { c.spatial_budget = kNan; }, "spatial_budget is nan");
  refused([](auto& c) { c.max_depth = 8; }, "max_depth is 8");
}

TEST(CapiBvh2, what_queries_use_does_not_matter_to_binary_trees) {
  Call call;
  call.config.simd = 99, call.config.width = 99;
  Tree made(call.mesh.triangle_count);
  EXPECT_EQ(umbel_bvh2_requirements(call.mesh.triangle_count, &call.config, &made.needed), UMBEL_OK)
      << umbel_last_error();
  EXPECT_EQ(umbel_bvh2_build_triangles(&call.mesh, &call.config, nullptr, &made.tree), UMBEL_OK)
      << umbel_last_error();
  umbel_bvh2_statistics found;
  umbel_bvh2_statistics_init(&found);
  EXPECT_EQ(umbel_bvh2_get_statistics(&made.tree, &call.config, &found), UMBEL_OK);
  EXPECT_EQ(umbel_bvh_config_preset(&call.config, "fast"), UMBEL_OK);
  EXPECT_EQ(call.config.simd, 99u);
}

TEST(CapiBvh2, spatial_splits_fit_what_they_require) {
  Call call(large_triangles(500));
  call.config.builder = UMBEL_BVH_SPATIAL;
  for (const float budget : {0.0f, 0.1f, 1.0f, 4.0f}) {
    call.config.spatial_budget = budget;
    call.config.spatial_overlap = 0;
    Tree made(call.mesh.triangle_count, &call.config);
    EXPECT_EQ(umbel_bvh2_build_triangles(&call.mesh, &call.config, nullptr, &made.tree), UMBEL_OK)
        << umbel_last_error();
  }
}

}  // namespace
}  // namespace umbel
