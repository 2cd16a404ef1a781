// Meshes and configurations for tests of clusters of one frame, and what must hold of the clusters.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <span>
#include <vector>

#include "base/math.hpp"
#include "cluster/cluster_cases.hpp"
#include "umbel/frame_clusters.hpp"

namespace umbel::testing {

/// Every configuration that changes what is done.
inline std::vector<FrameClusterConfig> configs() {
  std::vector<FrameClusterConfig> all;
  for (const FrameMethod method : {FrameMethod::kMorton, FrameMethod::kHybrid})
    for (const uint32_t bits : {30u, 63u})
      for (const uint32_t vertices : {0u, 48u})
        for (const uint32_t max : {128u, 37u}) {
          FrameClusterConfig config;
          config.method = method;
          config.code_bits = bits;
          config.max_vertices = vertices;
          config.max_triangles = max;
          all.push_back(config);
        }
  return all;
}

inline Mesh soup(uint32_t triangles, uint32_t seed) {
  return cluster_cases::soup(triangles, seed, 0.05f, {4, 1, 0.2f});
}

inline FrameClusterer clusters_of(const Mesh& mesh, const FrameClusterConfig& config,
                                  uint32_t threads = 0) {
  FrameClusterer clusters(mesh.triangles, mesh.positions.size(), config);
  clusters.build(mesh.positions, {nullptr, threads});
  return clusters;
}

template <typename T>
std::vector<T> copy(std::span<const T> span) {
  return {span.begin(), span.end()};
}

inline uint32_t vertices_of(const FrameClusterer& c, size_t cluster) {
  std::set<uint32_t> vertices;
  for (uint32_t i = c.offsets()[cluster]; i < c.offsets()[cluster + 1]; ++i)
    vertices.insert(c.triangles()[i].begin(), c.triangles()[i].end());
  return uint32_t(vertices.size());
}

/// What must hold of clusters of any frame.
inline void expect_sound(const FrameClusterer& c, const Mesh& mesh,
                         const FrameClusterConfig& config) {
  const size_t n = mesh.triangles.size();
  ASSERT_EQ(c.items().size(), n);
  ASSERT_EQ(c.offsets().front(), 0u);
  ASSERT_EQ(c.offsets().back(), n);
  ASSERT_LE(c.count(), max_frame_clusters(uint32_t(n), config));
  std::vector<uint32_t> seen = copy(c.items());
  std::sort(seen.begin(), seen.end());
  for (size_t i = 0; i < n; ++i) ASSERT_EQ(seen[i], i);
  for (size_t i = 0; i < n; ++i) ASSERT_EQ(c.triangles()[i], mesh.triangles[c.items()[i]]);
  const uint32_t least = config.min_triangles ? config.min_triangles : config.max_triangles / 4;
  uint32_t small = 0;
  for (size_t k = 0; k < c.count(); ++k) {
    ASSERT_LT(c.offsets()[k], c.offsets()[k + 1]);
    const uint32_t size = c.offsets()[k + 1] - c.offsets()[k];
    ASSERT_LE(size, config.max_triangles);
    small += size < (config.method == FrameMethod::kHybrid ? least : config.max_triangles);
    if (config.max_vertices) ASSERT_LE(vertices_of(c, k), config.max_vertices);
    Aabb box;
    for (uint32_t i = c.offsets()[k]; i < c.offsets()[k + 1]; ++i)
      for (const uint32_t v : c.triangles()[i]) extend(box, mesh.positions[v]);
    ASSERT_EQ(c.boxes()[k], box);
  }
  if (!config.max_vertices) ASSERT_LE(small, 1u);
}

/// A team's threads meet some thousand times for a mesh, so only what differs is tried.
inline std::vector<FrameClusterConfig> configs_for_teams() {
  std::vector<FrameClusterConfig> all = configs();
  std::erase_if(all, [](const FrameClusterConfig& c) { return c.code_bits == 63; });
  return all;
}

/// Bends what was straight.
inline Mesh deformed(Mesh mesh, float angle) {
  for (Vec3& p : mesh.positions) {
    const float a = angle * p.x;
    p = {p.x, p.y * std::cos(a) - p.z * std::sin(a), p.y * std::sin(a) + p.z * std::cos(a)};
  }
  return mesh;
}

}  // namespace umbel::testing
