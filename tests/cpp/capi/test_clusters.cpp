// The C interface gives what the C++ one gives.
#include <gtest/gtest.h>

#include <cmath>

#include "capi/cluster_call.hpp"

namespace umbel {
namespace {

using namespace cluster_call;

TEST(Capi, result_equals_the_cpp_result_for_random_input) {
  for (uint32_t seed = 1; seed <= 300; ++seed) {
    const RandomItems items(seed);
    const Clusters expected = build_clusters(items.input, items.config);
    Call call;
    call.set(items.input);
    call.set(items.config);
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    ASSERT_LE(call.output.range_count, call.capacity.ranges) << seed;
    ASSERT_EQ(call.output.item_count, call.capacity.items) << seed;
    ASSERT_EQ(call.output.segment_count, call.capacity.segments) << seed;
    expect_equal(call.clusters(), expected);
    if (HasFailure()) FAIL() << "seed " << seed;
  }
}

TEST(Capi, metrics_equal_the_cpp_metrics_for_random_input) {
  for (uint32_t seed = 1; seed <= 30; ++seed) {
    const RandomItems items(seed);
    const ClusterMetrics expected = cluster_metrics(
        items.input, build_clusters(items.input, items.config), items.config.max_items);
    Call call;
    call.set(items.input);
    call.set(items.config);
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    ASSERT_EQ(
        umbel_cluster_get_metrics(&call.input, &call.output, items.config.max_items, &call.metrics),
        UMBEL_OK)
        << umbel_last_error();
    EXPECT_EQ(call.metrics.struct_size, sizeof call.metrics);
    EXPECT_EQ(call.metrics.clusters, expected.clusters);
    EXPECT_EQ(call.metrics.min_size, expected.min_size);
    EXPECT_EQ(call.metrics.max_size, expected.max_size);
    EXPECT_EQ(call.metrics.max_vertices, expected.max_vertices);
    EXPECT_EQ(call.metrics.mean_fill, expected.mean_fill);
    EXPECT_EQ(call.metrics.mean_vertices, expected.mean_vertices);
    EXPECT_EQ(call.metrics.surface_area_ratio, expected.surface_area_ratio);
    EXPECT_EQ(call.metrics.sah, expected.sah);
    EXPECT_EQ(call.metrics.overlap, expected.overlap);
    EXPECT_EQ(call.metrics.ratio_cut, expected.ratio_cut);
  }
}

TEST(Capi, triangles_given_by_positions_equal_the_cpp_mesh) {
  const Mesh mesh = grid();
  for (const float weight : {0.0f, 1.0f}) {
    Call call;
    set_mesh(call, mesh);
    call.input.shared_vertex_weight = weight;
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    expect_equal(call.clusters(), cluster_mesh(mesh.view(), ClusterConfig{}, weight));
  }
}

TEST(Capi, triangles_given_by_positions_take_segments) {
  const Mesh mesh = grid();
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  const std::vector<Range> segments{{100, 300}, {0, 100}, {500, 0}, {600, 1000}};
  ClusterInput same;
  same.boxes = boxes;
  same.segments = segments;
  Call call;
  set_mesh(call, mesh);
  call.input.segments = reinterpret_cast<const umbel_range*>(segments.data());
  call.input.segment_count = segments.size();
  ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
  expect_equal(call.clusters(), build_clusters(same, ClusterConfig{}));
  EXPECT_EQ(umbel_cluster_get_metrics(&call.input, &call.output, 128, &call.metrics), UMBEL_OK);
}

TEST(Capi, result_does_not_depend_on_threads) {
  const Mesh mesh = shapes::blob(5, 1);
  Clusters first;
  for (const uint32_t threads : {1u, 2u, 8u}) {
    Call call;
    set_mesh(call, mesh);
    call.options.threads = threads;
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    if (threads == 1) first = call.clusters();
    expect_equal(call.clusters(), first);
  }
}

TEST(Capi, defaults_are_the_cpp_defaults) {
  const Mesh mesh = grid();
  Call call;
  set_mesh(call, mesh);
  ASSERT_EQ(umbel_cluster_requirements(&call.input, nullptr, &call.capacity), UMBEL_OK);
  call.reserve(call.capacity.ranges, call.capacity.items, 0);
  ASSERT_EQ(umbel_cluster_build(&call.input, nullptr, nullptr, &call.output), UMBEL_OK);
  call.output.segment_count = 0;
  Clusters expected = cluster_mesh(mesh.view(), ClusterConfig{});
  expected.segments.clear();
  expect_equal(call.clusters(), expected);
}

TEST(Capi, presets_are_the_cpp_presets) {
  const Mesh mesh = grid();
  for (const char* name : {"quality", "fast", "exact"}) {
    Call call;
    set_mesh(call, mesh);
    ASSERT_EQ(umbel_cluster_config_preset(&call.config, name, 48), UMBEL_OK);
    EXPECT_EQ(call.config.struct_size, sizeof call.config);
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    expect_equal(call.clusters(), cluster_mesh(mesh.view(), cluster_preset(name, 48)));
  }
}

TEST(Capi, empty_input_gives_an_empty_result) {
  Call call;
  ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(call.output.range_count, 0u);
  EXPECT_EQ(call.output.item_count, 0u);
  EXPECT_EQ(call.output.segment_count, 0u);
  EXPECT_EQ(umbel_cluster_get_metrics(&call.input, &call.output, 128, &call.metrics), UMBEL_OK);
  EXPECT_EQ(call.metrics.clusters, 0u);
}

}  // namespace
}  // namespace umbel
