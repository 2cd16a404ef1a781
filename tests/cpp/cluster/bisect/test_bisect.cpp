// Properties of clusters that hold for any input.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

TEST(Bisect, every_item_is_in_one_cluster_for_random_inputs_and_configs) {
  std::mt19937 random(7);
  for (int round = 0; round < 150; ++round) {
    const uint32_t count = random() % (round % 10 == 0 ? 20000 : 700);
    Items items = random() % 2 ? random_items(count, round) : items_of(soup(count, round));
    const uint32_t max_items = 1 + random() % 200;
    ClusterConfig config = limits(1 + random() % max_items, max_items);
    config.underfill_cost = float(random() % 3) * 0.5f;
    config.overlap_cost = float(random() % 3) * 0.5f;
    config.presplit_threshold = random() % 3 ? 0 : random() % 1000;
    config.coarse = random() % 3 == 0;
    if (!items.vertices.empty() && random() % 2) config.max_vertices = 3 + random() % 200;
    if (random() % 2) {
      for (uint32_t at = 0; at < count;) {
        const uint32_t length = std::min(count - at, uint32_t(random() % 300));
        if (random() % 5) items.segments.push_back({at, length});
        at += length;
      }
      if (random() % 2) std::shuffle(items.segments.begin(), items.segments.end(), random);
    }
    checked(items, config);
    if (HasFatalFailure()) FAIL() << "round " << round;
  }
}

TEST(Bisect, sizes_stay_within_every_pair_of_limits) {
  const Items items = random_items(1000, 3);
  for (uint32_t max_items = 1; max_items <= 40; ++max_items)
    for (uint32_t min_items = 1; min_items <= max_items; ++min_items)
      checked(items, limits(min_items, max_items));
  for (uint32_t count = 1; count < 300; ++count) {
    checked(random_items(count, count), limits(96, 128));
    checked(random_items(count, count), limits(24, 32));
    checked(random_items(count, count), limits(7, 7));
  }
}

TEST(Bisect, exact_preset_fills_all_clusters_but_one) {
  for (const uint32_t count : {70000u, 5000u, 129u, 128u, 127u}) {
    const Clusters c = checked(random_items(count, 1), cluster_preset("exact"));
    EXPECT_EQ(c.ranges.size(), (count + 127) / 128);
  }
}

TEST(Bisect, one_hundred_thousand_segments_are_clustered_each_by_itself) {
  Items items = random_items(300000, 5);
  for (uint32_t i = 0; i < 100000; ++i) items.segments.push_back({i * 3, 3});
  const Clusters c = checked(items, limits(1, 2));
  EXPECT_GE(c.ranges.size(), 200000u);
}

TEST(Bisect, fast_preset_has_little_more_area_than_quality) {
  const Mesh mesh = grid(300, 300, 8.0f);
  const Items items = items_of(mesh);
  const auto area = [&](const char* preset) {
    const ClusterConfig config = cluster_preset(preset);
    return cluster_metrics(items.input(), checked(items, config), 128).surface_area_ratio;
  };
  EXPECT_LE(area("fast"), 1.2 * area("quality"));
}

TEST(Bisect, progress_never_falls_ends_at_one_and_can_cancel) {
  const Items items = random_items(200000, 21);
  BuildOptions options;
  float last = 0;
  int calls = 0;
  options.progress = [&](float fraction, std::string_view) {
    EXPECT_GE(fraction, last);
    last = fraction;
    ++calls;
    return true;
  };
  build_clusters(items.input(), limits(32, 128), options);
  EXPECT_EQ(last, 1.0f);
  EXPECT_GT(calls, 2);
  for (const int at : {1, 2, 3}) {
    int left = at;
    options.progress = [&](float, std::string_view) { return --left > 0; };
    try {
      build_clusters(items.input(), limits(32, 128), options);
      ADD_FAILURE() << "not cancelled";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
  }
}

TEST(Bisect, sampled_overlap_agrees_with_the_area_ratio) {
  const Items items = random_items(5000, 22);
  const ClusterMetrics m = cluster_metrics(items.input(), checked(items, limits(32, 128)), 128);
  EXPECT_NEAR(m.overlap, m.surface_area_ratio, 0.05 * m.surface_area_ratio);
}

// Hardly any line that meets the sphere around a long box meets the box.
TEST(Bisect, sampled_overlap_agrees_with_the_area_ratio_of_long_and_flat_meshes) {
  const Items items = random_items(5000, 22);
  const Clusters c = checked(items, limits(32, 128));
  for (const Vec3 scale :
       {Vec3{1e5f, 1, 1}, Vec3{1, 1e3f, 1}, Vec3{1e3f, 1, 1e3f}, Vec3{1, 9, 0}}) {
    Items stretched = items;
    for (Aabb& b : stretched.boxes)
      b = {{b.min.x * scale.x, b.min.y * scale.y, b.min.z * scale.z},
           {b.max.x * scale.x, b.max.y * scale.y, b.max.z * scale.z}};
    const ClusterMetrics m = cluster_metrics(stretched.input(), c, 128);
    EXPECT_NEAR(m.overlap, m.surface_area_ratio, 0.05 * m.surface_area_ratio) << scale.x;
  }
}

TEST(Morton, only_the_most_items_count) {
  const Mesh mesh = grid(20, 20, 3.0f);
  ClusterConfig config;
  config.max_items = 32;  // fewer than the default of min_items
  EXPECT_EQ(cluster_mesh_morton(mesh.view(), config).ranges.size(), 25u);
  config.underfill_cost = -1;
  config.min_items = 0;
  EXPECT_EQ(cluster_mesh_morton(mesh.view(), config).ranges.size(), 25u);
  config.max_items = 0;
  EXPECT_THROW(cluster_mesh_morton(mesh.view(), config), Error);
}

TEST(Morton, clusters_are_full_and_hold_every_triangle_once) {
  const Mesh mesh = grid(123, 77, 3.0f);
  const Clusters c = cluster_mesh_morton(mesh.view(), limits(1, 100));
  const Items items = items_of(mesh);
  expect_valid(items, limits(100, 100), c);
}

}  // namespace
}  // namespace umbel
