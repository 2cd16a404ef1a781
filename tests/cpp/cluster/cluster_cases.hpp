// Items and meshes to cluster, and what must hold of every result.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <random>
#include <set>

#include "base/math.hpp"
#include "cluster/bisect/bisect.hpp"
#include "umbel/cluster.hpp"

namespace umbel::cluster_cases {

struct Items {
  std::vector<Aabb> boxes;
  std::vector<Vec3> centroids;
  std::vector<uint32_t> vertices;
  std::vector<Range> segments;
  std::vector<Range> ranges;
  std::vector<uint32_t> targets;
  std::vector<float> weights;

  ClusterInput input() const {
    ClusterInput in;
    in.boxes = boxes;
    in.centroids = centroids;
    in.item_vertices = vertices;
    in.vertices_per_item = vertices.empty() ? 0 : 3;
    in.segments = segments;
    in.connections = {ranges, targets, weights};
    return in;
  }
};

inline Items random_items(uint32_t count, uint32_t seed, float size = 0.05f) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Items items;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 p{unit(random), unit(random), unit(random)};
    items.boxes.push_back({p, p + size * Vec3{unit(random), unit(random), unit(random)}});
  }
  return items;
}

inline Mesh grid(uint32_t columns, uint32_t rows, float wave = 0.0f) {
  Mesh mesh;
  for (uint32_t y = 0; y <= rows; ++y)
    for (uint32_t x = 0; x <= columns; ++x)
      mesh.positions.push_back(
          {float(x), float(y), wave * std::sin(0.3f * float(x)) * std::cos(0.2f * float(y))});
  const uint32_t w = columns + 1;
  for (uint32_t y = 0; y < rows; ++y)
    for (uint32_t x = 0; x < columns; ++x) {
      const uint32_t v = y * w + x;
      mesh.triangles.push_back({v, v + 1, v + w});
      mesh.triangles.push_back({v + 1, v + w + 1, v + w});
    }
  return mesh;
}

/// Small triangles in the box from zero to `extent`.
inline Mesh soup(uint32_t triangles, uint32_t seed, float size = 0.02f, Vec3 extent = {1, 1, 1}) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Mesh mesh;
  for (uint32_t i = 0; i < triangles; ++i) {
    const Vec3 p{extent.x * unit(random), extent.y * unit(random), extent.z * unit(random)};
    for (int k = 0; k < 3; ++k)
      mesh.positions.push_back(p + size * Vec3{unit(random), unit(random), unit(random)});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

inline Mesh fan(uint32_t triangles) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, 0});
  for (uint32_t i = 0; i <= triangles; ++i) {
    const float a = 6.2831853f * float(i) / float(triangles);
    mesh.positions.push_back({std::cos(a), std::sin(a), 0});
  }
  for (uint32_t i = 0; i < triangles; ++i) mesh.triangles.push_back({0, i + 1, i + 2});
  return mesh;
}

inline Items items_of(const Mesh& mesh) {
  Items items;
  items.boxes = triangle_boxes(mesh.view());
  for (const Triangle& t : mesh.triangles)
    items.vertices.insert(items.vertices.end(), t.begin(), t.end());
  return items;
}

inline size_t unique_vertices(const Items& items, const Clusters& c, const Range& r) {
  std::set<uint32_t> unique;
  for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
    for (int k = 0; k < 3; ++k) unique.insert(items.vertices[size_t(c.items[i]) * 3 + k]);
  return unique.size();
}

// Everything that the header promises about a result.
inline void expect_valid(const Items& items, const ClusterConfig& config, const Clusters& c) {
  const uint32_t count = uint32_t(items.boxes.size());
  ASSERT_EQ(c.items.size(), count);
  std::vector<uint8_t> seen(count, 0);
  for (const uint32_t item : c.items) {
    ASSERT_LT(item, count);
    EXPECT_EQ(seen[item]++, 0) << "item " << item << " twice";
  }
  std::vector<Range> segments = items.segments;
  if (segments.empty() && count) segments = {{0, count}};
  ASSERT_EQ(c.segments.size(), segments.size());
  std::vector<uint8_t> in_segment(count, 0);
  for (size_t s = 0; s < segments.size(); ++s) {
    const Range& segment = segments[s];
    uint32_t at = segment.offset, undersized = 0;
    for (uint32_t k = c.segments[s].offset; k < c.segments[s].offset + c.segments[s].count; ++k) {
      const Range& r = c.ranges[k];
      ASSERT_EQ(r.offset, at);
      ASSERT_GE(r.count, 1u);
      EXPECT_LE(r.count, config.max_items);
      undersized += r.count < config.min_items;
      if (config.max_vertices) EXPECT_LE(unique_vertices(items, c, r), config.max_vertices);
      for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
        EXPECT_GE(c.items[i], segment.offset);
        EXPECT_LT(c.items[i], segment.offset + segment.count);
        in_segment[i] = 1;
      }
      at += r.count;
    }
    EXPECT_EQ(at, segment.offset + segment.count);
    if (!config.max_vertices) EXPECT_LE(undersized, 1u);
  }
  for (uint32_t i = 0; i < count; ++i)
    if (!in_segment[i]) EXPECT_EQ(c.items[i], i);
}

// Does it, and fails if that takes more than 10 seconds of one core.
template <typename Work>
auto in_time(const Work& work) {
  struct Guard {
    std::clock_t start = std::clock();  // of all threads
    ~Guard() { EXPECT_LT(double(std::clock() - start) / CLOCKS_PER_SEC, 10); }
  } guard;
  return work();
}

// Clusters them in time, and checks the result.
inline Clusters checked(const Items& items, const ClusterConfig& config, uint32_t threads = 0) {
  BuildOptions options;
  options.threads = threads;
  Clusters c = in_time([&] { return build_clusters(items.input(), config, options); });
  expect_valid(items, config, c);
  return c;
}

using Partition = std::set<std::set<uint32_t>>;

/// The sets of items that are clusters, by their `names` where they have some.
inline Partition partition_of(const Clusters& c, const std::vector<uint32_t>* names = nullptr) {
  Partition all;
  for (const Range& r : c.ranges) {
    std::set<uint32_t> one;
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
      one.insert(names ? (*names)[c.items[i]] : c.items[i]);
    all.insert(one);
  }
  return all;
}

inline bool same(const Clusters& a, const Clusters& b) {
  return a.items == b.items && a.ranges == b.ranges && a.segments == b.segments;
}

inline ClusterConfig limits(uint32_t min_items, uint32_t max_items, uint32_t max_vertices = 0) {
  ClusterConfig config;
  config.min_items = min_items;
  config.max_items = max_items;
  config.max_vertices = max_vertices;
  return config;
}

template <typename Work>
void expect_error(ErrorCode code, const std::string& named, const Work& work) {
  try {
    in_time(work);
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_GT(std::string(error.what()).size(), 10u);
    EXPECT_NE(std::string(error.what()).find(named), std::string::npos) << error.what();
  }
}

inline void expect_error(ErrorCode code, const ClusterInput& input, const ClusterConfig& config) {
  expect_error(code, "", [&] { build_clusters(input, config); });
  Clusters out;
  expect_error(code, "", [&] { cluster::Bisector().build(input, config, out); });
}

}  // namespace umbel::cluster_cases
