// Clusters with their geometry that wait for a group.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::lod {

/// Each cluster has its own list of vertices (indices into the welded mesh) and triangles as
/// triples of indices into that list.
struct ClusterSet {
  std::vector<uint32_t> vertex_offsets{0};
  std::vector<uint32_t> triangle_offsets{0};
  std::vector<uint32_t> vertices;
  std::vector<uint8_t> corners;  ///< 3 a triangle
  std::vector<uint32_t> generating_group;
  std::vector<uint32_t> material;
  std::vector<Aabb> boxes;

  size_t size() const { return boxes.size(); }
  size_t triangle_count() const { return triangle_offsets.back(); }

  std::span<const uint32_t> cluster_vertices(size_t i) const {
    return {vertices.data() + vertex_offsets[i], vertex_offsets[i + 1] - vertex_offsets[i]};
  }
  std::span<const uint8_t> cluster_corners(size_t i) const {
    return {corners.data() + 3 * size_t{triangle_offsets[i]},
            3 * size_t{triangle_offsets[i + 1] - triangle_offsets[i]}};
  }

  void clear() { *this = ClusterSet{}; }

  void append(std::span<const uint32_t> cluster_vertices, std::span<const uint8_t> cluster_corners,
              uint32_t group, uint32_t cluster_material, const Aabb& box) {
    vertices.insert(vertices.end(), cluster_vertices.begin(), cluster_vertices.end());
    corners.insert(corners.end(), cluster_corners.begin(), cluster_corners.end());
    vertex_offsets.push_back(static_cast<uint32_t>(vertices.size()));
    triangle_offsets.push_back(static_cast<uint32_t>(corners.size() / 3));
    generating_group.push_back(group);
    material.push_back(cluster_material);
    boxes.push_back(box);
  }
};

struct ClusterRef {
  const ClusterSet* set;
  uint32_t index;
};

/// Copies of clusters of several sets, in their order.
ClusterSet gather_clusters(std::span<const ClusterRef> clusters);

}  // namespace umbel::lod
