// What must not change clusters: threads, scale, translation, the order of items.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

TEST(BisectInvariance, result_does_not_depend_on_the_number_of_threads) {
  for (const bool limited : {false, true}) {
    const Items items = items_of(grid(300, 250, 5.0f));
    ClusterConfig config = limits(32, 128, limited ? 80 : 0);
    const Clusters one = checked(items, config, 1);
    EXPECT_TRUE(same(one, checked(items, config, 2)));
    EXPECT_TRUE(same(one, checked(items, config, 8)));
    Clusters alone;
    cluster::Bisector bisector;
    bisector.build(items.input(), config, alone);
    EXPECT_TRUE(same(one, alone));
    bisector.build(items.input(), config, alone);
    EXPECT_TRUE(same(one, alone));
  }
}

TEST(BisectInvariance, connected_items_do_not_depend_on_the_number_of_threads) {
  Items items = random_items(12000, 21);
  std::mt19937 random(4);
  for (uint32_t i = 0; i < 12000; ++i) {
    items.ranges.push_back({uint32_t(items.targets.size()), 4});
    for (int k = 0; k < 4; ++k) {
      items.targets.push_back((i + 1 + random() % 200) % 12000);
      items.weights.push_back(static_cast<float>(random() % 1000) * 0.07f);
    }
  }
  const ClusterConfig config = limits(24, 32);
  const Clusters one = checked(items, config, 1);
  for (const uint32_t threads : {2u, 8u}) EXPECT_TRUE(same(one, checked(items, config, threads)));
  Clusters alone;
  cluster::Bisector().build(items.input(), config, alone);
  EXPECT_TRUE(same(one, alone));

  const Mesh mesh = grid(120, 100, 5.0f);
  const auto shared = [&](uint32_t threads) {
    return cluster_mesh(mesh.view(), limits(32, 128), 1.0f, {{}, threads});
  };
  for (const uint32_t threads : {2u, 8u}) EXPECT_TRUE(same(shared(1), shared(threads)));
}

TEST(BisectInvariance, mesh_and_boxes_give_the_same_clusters) {
  const Mesh mesh = grid(200, 200, 5.0f);
  EXPECT_TRUE(same(cluster_mesh(mesh.view(), limits(32, 128, 100)),
                   checked(items_of(mesh), limits(32, 128, 100))));
}

TEST(BisectInvariance, power_of_two_scale_does_not_change_the_partition) {
  for (const uint32_t count : {3000u, 40000u}) {
    const Items items = random_items(count, 11);
    const Clusters base = checked(items, limits(32, 128));
    for (const int exponent : {-60, -20, -1, 1, 20, 60, 100}) {
      Items scaled = items;
      for (Aabb& b : scaled.boxes)
        b = {b.min * std::ldexp(1.0f, exponent), b.max * std::ldexp(1.0f, exponent)};
      EXPECT_TRUE(same(base, checked(scaled, limits(32, 128)))) << "2^" << exponent;
    }
  }
}

// Coordinates are multiples of 2^-12, so that adding an offset does not round.
TEST(BisectInvariance, translation_does_not_change_the_partition) {
  for (const uint32_t count : {3000u, 40000u}) {
    Items items = random_items(count, 12);
    for (Aabb& b : items.boxes)
      for (float* f : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z})
        *f = std::round(*f * 4096) / 4096;
    const Clusters base = checked(items, limits(32, 128));
    for (const Vec3 offset : {Vec3{1, 2, -3}, Vec3{-100, 50, 7}, Vec3{1000, 1000, 1000}}) {
      Items moved = items;
      for (Aabb& b : moved.boxes) b = {b.min + offset, b.max + offset};
      EXPECT_TRUE(same(base, checked(moved, limits(32, 128))));
    }
  }
}

TEST(BisectInvariance, permutation_of_items_does_not_change_the_partition) {
  const Items items = random_items(30000, 13);
  const Clusters base = checked(items, limits(32, 128));
  std::vector<uint32_t> to(items.boxes.size());
  for (uint32_t i = 0; i < to.size(); ++i) to[i] = i;
  std::shuffle(to.begin(), to.end(), std::mt19937(1));
  Items shuffled = items;
  for (uint32_t i = 0; i < to.size(); ++i) shuffled.boxes[to[i]] = items.boxes[i];
  const Clusters other = checked(shuffled, limits(32, 128));
  EXPECT_EQ(partition_of(base, &to), partition_of(other));
}

}  // namespace
}  // namespace umbel
