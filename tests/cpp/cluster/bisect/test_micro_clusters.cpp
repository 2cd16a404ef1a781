// The fast preset, which looks at micro-clusters instead of items.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "cluster/bisect/bisect.hpp"
#include "cluster/cluster_cases.hpp"
#include "umbel/cluster.hpp"

namespace umbel {
namespace {

using cluster_cases::Partition, cluster_cases::partition_of;

ClusterInput input_of(const std::vector<Aabb>& boxes) {
  ClusterInput input;
  input.boxes = boxes;
  return input;
}

std::vector<Aabb> random_boxes(uint32_t count, uint32_t seed, float flat = 1.0f) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  const auto rounded = [](float x) { return std::round(x * 4096) / 4096; };
  std::vector<Aabb> boxes;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 p{rounded(unit(random)), rounded(unit(random)), rounded(unit(random) * flat)};
    boxes.push_back({p,
                     {p.x + rounded(0.03f * unit(random)), p.y + rounded(0.03f * unit(random)),
                      p.z + rounded(0.03f * unit(random))}});
  }
  return boxes;
}

Clusters fast(const std::vector<Aabb>& boxes, uint32_t threads = 0) {
  BuildOptions options;
  options.threads = threads;
  return build_clusters(input_of(boxes), cluster_preset("fast"), options);
}

void expect_valid(const Clusters& c, uint32_t count, uint32_t least, uint32_t most) {
  std::vector<uint8_t> seen(count, 0);
  uint32_t at = 0, undersized = 0;
  for (const Range& r : c.ranges) {
    ASSERT_EQ(r.offset, at);
    EXPECT_LE(r.count, most);
    undersized += r.count < least;
    at += r.count;
  }
  EXPECT_EQ(at, count);
  EXPECT_LE(undersized, 1u);
  for (const uint32_t item : c.items) EXPECT_EQ(seen.at(item)++, 0);
}

TEST(MicroClusters, sizes_are_within_limits_for_any_shape) {
  for (const uint32_t count : {1000u, 1025u, 5000u, 100000u})
    for (const float flat : {1.0f, 0.01f, 0.0f})
      for (const uint32_t least : {1u, 32u, 64u, 96u, 127u}) {
        ClusterConfig config = cluster_preset("fast");
        config.min_items = least;
        expect_valid(build_clusters(input_of(random_boxes(count, least, flat)), config), count,
                     least, config.max_items);
      }
}

TEST(MicroClusters, degenerate_inputs_end_in_valid_clusters) {
  std::vector<std::vector<Aabb>> inputs(4);
  inputs[0].assign(50000, {{1, 2, 3}, {2, 3, 4}});
  inputs[1].assign(50000, {{1, 2, 3}, {1, 2, 3}});
  for (int i = 1; i <= 50000; ++i)
    inputs[2].push_back({{-float(i), -float(i), -float(i)}, {float(i), float(i), float(i)}});
  for (int i = 0; i < 50000; ++i) inputs[3].push_back({{float(i), 0, 0}, {float(i + 1), 0, 0}});
  for (const float size : {1e-44f, 1e-30f, 1e30f, 1.5e38f}) {
    inputs.push_back(random_boxes(50000, 5));
    for (Aabb& b : inputs.back())
      for (float* f : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z})
        *f = (*f - 0.5f) * 2 * size;
  }
  for (const std::vector<Aabb>& boxes : inputs) expect_valid(fast(boxes), 50000, 32, 128);
}

TEST(MicroClusters, result_does_not_depend_on_the_number_of_threads) {
  const std::vector<Aabb> boxes = random_boxes(300000, 6);
  const Clusters one = fast(boxes, 1);
  for (const uint32_t threads : {2u, 8u}) {
    const Clusters other = fast(boxes, threads);
    EXPECT_TRUE(one.items == other.items && one.ranges == other.ranges);
  }
  Clusters alone;
  cluster::Bisector().build(input_of(boxes), cluster_preset("fast"), alone);
  EXPECT_TRUE(one.items == alone.items && one.ranges == alone.ranges);
}

TEST(MicroClusters, scale_translation_and_permutation_do_not_change_the_partition) {
  const std::vector<Aabb> boxes = random_boxes(40000, 7);
  const Partition base = partition_of(fast(boxes));
  for (const int exponent : {-60, -1, 20, 100}) {
    std::vector<Aabb> other = boxes;
    for (Aabb& b : other)
      for (float* f : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z})
        *f = std::ldexp(*f, exponent);
    EXPECT_EQ(base, partition_of(fast(other))) << exponent;
  }
  std::vector<Aabb> moved = boxes;
  for (Aabb& b : moved)
    for (float* f : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z}) *f += 100;
  EXPECT_EQ(base, partition_of(fast(moved)));
  std::vector<uint32_t> names(boxes.size());
  for (uint32_t i = 0; i < names.size(); ++i) names[i] = i;
  std::shuffle(names.begin(), names.end(), std::mt19937(8));
  std::vector<Aabb> shuffled;
  for (const uint32_t i : names) shuffled.push_back(boxes[i]);
  EXPECT_EQ(base, partition_of(fast(shuffled), &names));
}

TEST(MicroClusters, one_far_item_costs_little_area) {
  std::vector<Aabb> boxes = random_boxes(40000, 9);
  boxes[777] = {{1e9f, 1e9f, 1e9f}, {1e9f, 1e9f, 1e9f}};
  const auto area = [&](const char* preset) {
    const Clusters c = build_clusters(input_of(boxes), cluster_preset(preset));
    double sum = 0;
    for (const Range& r : c.ranges) {
      Vec3 low = boxes[c.items[r.offset]].min, high = boxes[c.items[r.offset]].max;
      for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
        const Aabb& b = boxes[c.items[i]];
        low = {std::min(low.x, b.min.x), std::min(low.y, b.min.y), std::min(low.z, b.min.z)};
        high = {std::max(high.x, b.max.x), std::max(high.y, b.max.y), std::max(high.z, b.max.z)};
      }
      const Vec3 d{high.x - low.x, high.y - low.y, high.z - low.z};
      if (high.x < 2) sum += double(d.x) * d.y + double(d.y) * d.z + double(d.z) * d.x;
    }
    return sum;
  };
  EXPECT_LT(area("fast"), 1.3 * area("quality"));
}

double fill_of(const Clusters& c, uint32_t most) {
  return double(c.items.size()) / (double(c.ranges.size()) * most);
}

TEST(MicroClusters, clusters_are_nearly_as_full_as_with_the_quality_preset) {
  for (const float flat : {1.0f, 0.02f}) {
    const std::vector<Aabb> boxes = random_boxes(50000, 11, flat);
    const Clusters quality = build_clusters(input_of(boxes), cluster_preset("quality"));
    EXPECT_GT(fill_of(fast(boxes), 128), fill_of(quality, 128) - 0.07);
  }
}

TEST(MicroClusters, coincident_items_are_divided_by_exact_position) {
  // Each set is two cubes far apart in its own scale; no cluster should have items of both.
  std::mt19937 random(12);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<Aabb> boxes;
  for (int set = 0; set < 20; ++set) {
    const float at = float(set) * 1000;
    for (int i = 0; i < 512; ++i) {
      const float x = at + 0.001f * unit(random) + (i % 2 ? 0.02f : 0.0f),
                  y = 0.001f * unit(random);
      boxes.push_back({{x, y, 0}, {x, y, 0}});
    }
  }
  const Clusters c = fast(boxes);
  expect_valid(c, uint32_t(boxes.size()), 32, 128);
  for (const Range& r : c.ranges) {
    const uint32_t first = c.items[r.offset];
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
      EXPECT_EQ(c.items[i] / 512, first / 512);
      EXPECT_EQ(c.items[i] % 2, first % 2);
    }
  }
}

TEST(MicroClusters, a_few_items_beside_a_crowd_are_in_full_enough_clusters) {
  for (const uint32_t others : {1u, 31u, 32u, 100u, 200u}) {
    std::vector<Aabb> boxes(2000, {{1, 1, 1}, {1, 1, 1}});
    for (uint32_t i = 0; i < others; ++i)
      boxes.push_back({{float(i + 2), 0, 0}, {float(i + 3), 1, 1}});
    const Clusters c = fast(boxes);
    expect_valid(c, uint32_t(boxes.size()), 32, 128);
    for (const Range& r : c.ranges) EXPECT_GE(r.count, 32u);
  }
}

TEST(MicroClusters, positions_that_no_triangle_uses_change_nothing) {
  Mesh mesh;
  const std::vector<Aabb> boxes = random_boxes(50000, 13);
  for (const Aabb& b : boxes) {
    const uint32_t v = uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {b.min, b.max, {b.min.x, b.max.y, b.min.z}});
    mesh.triangles.push_back({v, v + 1, v + 2});
  }
  for (const char* preset : {"fast", "quality"}) {
    const Clusters base = cluster_mesh(mesh.view(), cluster_preset(preset));
    for (const float far : {-100.0f, 1e30f, NAN, INFINITY}) {
      Mesh other = mesh;
      other.positions.push_back({far, 0.5f, 0.5f});
      const Clusters c = cluster_mesh(other.view(), cluster_preset(preset));
      EXPECT_TRUE(base.items == c.items && base.ranges == c.ranges) << preset << " " << far;
    }
  }
}

TEST(MicroClusters, used_positions_at_one_place_among_unused_ones_are_legal) {
  Mesh mesh;
  for (uint32_t i = 0; i < 20000; ++i) mesh.positions.push_back({float(i), 1, 2});
  mesh.triangles.assign(20000, {7, 7, 7});
  expect_valid(cluster_mesh(mesh.view(), cluster_preset("fast")), 20000, 32, 128);
}

}  // namespace
}  // namespace umbel
