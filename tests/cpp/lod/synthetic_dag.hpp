// What tests of selection and verification share: DAGs of shapes, tables without any geometry,
// and random numbers that are the same everywhere.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include "lod/build/hierarchy.hpp"
#include "umbel/lod.hpp"

namespace umbel::lod::testing {

/// A few levels and many groups of a small mesh.
inline Config small_config() {
  Config config;
  config.max_triangles = 32;
  config.max_vertices = 64;
  config.min_group = 4;
  config.max_group = 8;
  return config;
}

inline GeometryReader reader_of(const Dag& dag) {
  return [&dag](uint32_t cluster) { return dag.geometry(cluster); };
}

inline VerifyConfig verify_config_of(const Dag& dag, const Mesh& source, uint32_t cuts = 32) {
  VerifyConfig config;
  config.cuts = cuts;
  config.max_triangles = dag.config.max_triangles;
  config.max_vertices = dag.config.max_vertices;
  config.source_triangles = source.triangles.size();
  config.source_digest = triangle_set_digest(source.view());
  return config;
}

class Random {
 public:
  explicit Random(uint32_t seed) : engine_(seed) {}
  uint32_t below(uint32_t count) { return static_cast<uint32_t>(engine_() % count); }
  double uniform() { return static_cast<double>(engine_()) / 4294967296.0; }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double log_between(double low, double high) {
    return std::exp(between(std::log(low), std::log(high)));
  }
  /// In the cube [-1, 1]^3.
  Vec3 point() {
    return {static_cast<float>(between(-1, 1)), static_cast<float>(between(-1, 1)),
            static_cast<float>(between(-1, 1))};
  }

 private:
  std::mt19937 engine_;
};

/// Where and how large the spheres of `random_tables` are.
struct Extent {
  double scale = 1;
  Vec3 offset{0, 0, 0};
};

inline Sphere random_sphere(Random& random, const Extent& extent) {
  const Vec3 p = random.point();
  // Some are points, some coincide.
  const double radius = random.uniform() < 0.1 ? 0 : random.log_between(1e-4, 1);
  const bool central = random.uniform() < 0.05;
  const auto at = [&](float x, float o) {
    return static_cast<float>(o + (central ? 0.0 : x * extent.scale));
  };
  return {{at(p.x, extent.offset.x), at(p.y, extent.offset.y), at(p.z, extent.offset.z)},
          static_cast<float>(radius * extent.scale)};
}

/// Tables of three levels of groups that obey nothing but their links: the hierarchy must serve
/// any. Every group has two clusters, made from any group of the level below.
inline Tables random_tables(uint32_t seed, uint32_t groups, const Extent& extent) {
  Random random(seed);
  Tables tables;
  for (const uint32_t count : {groups, groups / 3 + 1, 1u}) {
    const uint32_t level = static_cast<uint32_t>(tables.levels.size());
    const Range below = level ? tables.levels.back() : Range{0, 0};
    tables.levels.push_back({static_cast<uint32_t>(tables.groups.size()), count});
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t g = static_cast<uint32_t>(tables.groups.size());
      Group group{};
      group.clusters = {static_cast<uint32_t>(tables.clusters.size()), 2};
      group.level = level;
      group.sphere = random_sphere(random, extent);
      group.error = random.uniform() < 0.05
                        ? 0.0f
                        : static_cast<float>(random.log_between(1e-6, 1e-1) * extent.scale);
      if (level == 2) {
        group.method = SimplifyMethod::kRoot;
        group.error = std::numeric_limits<float>::infinity();
      }
      tables.groups.push_back(group);
      for (int k = 0; k < 2; ++k) {
        Cluster cluster{};
        cluster.group = g;
        cluster.generating_group = level ? below.offset + random.below(below.count) : kNone;
        cluster.triangle_count = 1 + random.below(128);
        tables.clusters.push_back(cluster);
      }
    }
  }
  tables.nodes = build_hierarchy(tables);
  return tables;
}

inline View camera(const Vec3& eye, float threshold) {
  View view;
  view.kind = View::Kind::kCamera;
  view.eye = eye;
  view.threshold = threshold;
  return view;
}

/// An eye far away, near, inside a sphere, on its surface or at its centre, and a threshold at
/// which the answer is likely to turn over.
inline View random_camera(Random& random, const Tables& tables, const Extent& extent) {
  constexpr double kMax = std::numeric_limits<float>::max();
  const Node& node = tables.nodes[random.below(static_cast<uint32_t>(tables.nodes.size()))];
  const Vec3 direction = random.point();
  const double reach[] = {0.0, 1.0, random.uniform(), random.log_between(1, 10),
                          random.log_between(10, 1e6)};
  const double far = reach[random.below(5)] * std::max<double>(node.sphere.radius, extent.scale);
  const auto at = [&](float c, float d) {
    return static_cast<float>(std::clamp(c + far * d, -kMax, kMax));
  };
  const Vec3 eye{at(node.sphere.center.x, direction.x), at(node.sphere.center.y, direction.y),
                 at(node.sphere.center.z, direction.z)};
  const double x = double{eye.x} - node.sphere.center.x;
  const double y = double{eye.y} - node.sphere.center.y;
  const double z = double{eye.z} - node.sphere.center.z;
  const double distance = std::sqrt(x * x + y * y + z * z) - node.sphere.radius;
  double threshold = random.log_between(1e-9, 1e2);
  if (distance > 0 && std::isfinite(node.error) && random.uniform() < 0.8) {
    threshold = node.error / distance;
    if (random.uniform() < 0.5) threshold *= random.between(1 - 1e-6, 1 + 1e-6);
  }
  if (random.uniform() < 0.02) threshold = 0;
  return camera(eye, static_cast<float>(std::clamp(threshold, 0.0, kMax)));
}

}  // namespace umbel::lod::testing
