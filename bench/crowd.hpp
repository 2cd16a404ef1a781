// A crowd for selection: 10,000 instances of a mesh of about 1,000 groups, and who looks at
// them.
#pragma once

#include <cmath>
#include <vector>

#include "umbel/lod.hpp"
#include "umbel/mesh.hpp"

namespace bench {

struct Crowd {
  static constexpr int kHalf = 50, kSide = 2 * kHalf;
  umbel::lod::Dag dag;
  std::vector<umbel::Transform> instances;
  std::vector<umbel::Plane> planes;
  umbel::lod::View view;

  Crowd() {
    umbel::lod::Config config;
    config.max_triangles = 26;
    config.max_vertices = 64;
    dag = umbel::lod::build(umbel::shapes::blob(7, 3).view(), config);
    // In a grid, a little apart, each turned and of a size of its own.
    for (int i = 0; i < kSide * kSide; ++i) {
      const int column = i % kSide - kHalf, row = i / kSide - kHalf;
      const auto x = static_cast<float>(column), z = static_cast<float>(row);
      const auto a = static_cast<float>(i);
      const float size = 1 + 0.3f * std::sin(1.7f * a);
      const float c = size * std::cos(a), s = size * std::sin(a);
      instances.push_back({{c, 0, s, 4 * x, 0, size, 0, 0, -s, 0, c, 4 * z}});
    }
    const umbel::Camera camera{{0, 6, 0}, {100, 0, 60}, {0, 1, 0}, 1.0f};
    planes = umbel::lod::frustum_planes(camera, 16.0f / 9);
    view = umbel::lod::view_camera(camera.position, camera.fov_y, 1080, 1);
  }
};

/// Bytes of everything that a selection on a device must write and read, each once a step, and of
/// the tables.
inline double selection_bytes(const Crowd& crowd, double groups, size_t clusters) {
  const umbel::lod::Tables& tables = crowd.dag.tables;
  const auto instances = static_cast<double>(crowd.instances.size());
  const double words = instances * std::ceil(static_cast<double>(tables.groups.size()) / 32);
  const double all = static_cast<double>(sizeof(umbel::lod::Node) * tables.nodes.size() +
                                         sizeof(umbel::lod::Group) * tables.groups.size() +
                                         sizeof(umbel::lod::Cluster) * tables.clusters.size());
  // Transforms once, views and planes twice, offsets; bits cleared, set, counted and listed, and
  // their sums; groups written and read twice, their sizes and places; clusters.
  const double each = 48 + 2 * (28 + 16.0 * static_cast<double>(crowd.planes.size())) + 8;
  return all + instances * each + words * (4 * 4 + 8) + groups * (8 * 3 + 4 * 3 + 8 * 2) +
         4.0 * static_cast<double>(clusters);
}

}  // namespace bench
