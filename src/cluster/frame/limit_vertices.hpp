// Vertices of clusters, for any executor: splits clusters that use too many, and lists the vertices
// of each. A small hash table a cluster tells vertices apart.
#pragma once

#include <cstdint>

#include "base/exec.hpp"
#include "cluster/frame/frame_mesh.hpp"

namespace umbel::cluster {

/// The distinct vertices of one cluster, numbered as they come.
class FewVertices {
 public:
  static constexpr uint32_t kMost = 256;

  UMBEL_HOST_DEVICE FewVertices() { clear(); }
  UMBEL_HOST_DEVICE void clear() {
    size_ = 0;
    for (uint16_t& slot : slots_) slot = kFree;
  }
  UMBEL_HOST_DEVICE uint32_t size() const { return size_; }
  UMBEL_HOST_DEVICE uint32_t operator[](uint32_t number) const { return vertices_[number]; }
  UMBEL_HOST_DEVICE bool has(uint32_t vertex) const { return slots_[slot_of(vertex)] != kFree; }
  /// At most kMost distinct ones may be added.
  UMBEL_HOST_DEVICE uint32_t add(uint32_t vertex) {
    uint16_t& slot = slots_[slot_of(vertex)];
    if (slot == kFree) {
      vertices_[size_] = vertex;
      slot = uint16_t(size_++);
    }
    return slot;
  }
  UMBEL_HOST_DEVICE uint32_t missing_of(const Triangle& t) const {
    return (has(t[0]) ? 0 : 1) + (t[1] == t[0] || has(t[1]) ? 0 : 1) +
           (t[2] == t[0] || t[2] == t[1] || has(t[2]) ? 0 : 1);
  }

 private:
  static constexpr uint16_t kFree = 0xffff;
  static constexpr uint32_t kSlots = 2 * kMost;

  UMBEL_HOST_DEVICE uint32_t slot_of(uint32_t vertex) const {
    uint32_t slot = (vertex * 2654435769u) >> 23;
    while (slots_[slot] != kFree && vertices_[slots_[slot]] != vertex) slot = (slot + 1) % kSlots;
    return slot;
  }

  uint32_t vertices_[kMost];
  uint16_t slots_[kSlots];
  uint32_t size_;
};

/// Flags where clusters of the triangles at `indices` must begin.
template <typename Exec>
void limit_vertices(Exec& exec, const FrameMesh& mesh, const uint32_t* indices,
                    const uint32_t* offsets, const uint32_t* count, uint32_t most_clusters,
                    uint32_t max_vertices, uint8_t* first) {
  exec.for_each(most_clusters, [=] UMBEL_DEVICE_LAMBDA(size_t c) {
    if (c >= *count) return;
    FewVertices vertices;
    for (uint32_t i = offsets[c]; i < offsets[c + 1]; ++i) {
      const Triangle& t = mesh.triangles[indices[i]];
      if (vertices.size() + vertices.missing_of(t) > max_vertices) {
        first[i] = 1;
        vertices.clear();
      }
      for (int k = 0; k < 3; ++k) vertices.add(t[k]);
    }
  });
}

/// Clusters' own vertices: cluster c has vertices[offsets[c] .. offsets[c + 1]), and triangle i of
/// the clusters the corners[i] among them.
struct LocalLists {
  uint32_t* offsets;
  uint32_t* vertices;
  uint8_t* corners;  ///< three a triangle
};

/// No cluster may have more than FewVertices::kMost vertices.
template <typename Exec>
void list_vertices(Exec& exec, const FrameClusters& clusters, uint32_t most_clusters,
                   const LocalLists& out) {
  // Not within the scan, which few of a device's blocks do.
  exec.for_each(most_clusters, [=] UMBEL_DEVICE_LAMBDA(size_t c) {
    if (c >= *clusters.count) {
      out.offsets[c] = 0;
      return;
    }
    FewVertices vertices;
    for (uint32_t i = clusters.offsets[c]; i < clusters.offsets[c + 1]; ++i)
      for (int k = 0; k < 3; ++k)
        out.corners[size_t(i) * 3 + k] = uint8_t(vertices.add(clusters.triangles[i][k]));
    out.offsets[c] = vertices.size();
  });
  exec.exclusive_scan(
      most_clusters, [offsets = out.offsets] UMBEL_DEVICE_LAMBDA(size_t c) { return offsets[c]; },
      out.offsets);
  // Vertices have the numbers in which they come, so each follows those before it.
  exec.for_each(most_clusters, [=] UMBEL_DEVICE_LAMBDA(size_t c) {
    if (c >= *clusters.count) return;
    uint32_t next = 0;
    for (uint32_t i = clusters.offsets[c]; i < clusters.offsets[c + 1]; ++i)
      for (int k = 0; k < 3; ++k)
        if (out.corners[size_t(i) * 3 + k] == next)
          out.vertices[out.offsets[c] + next++] = clusters.triangles[i][k];
  });
}

}  // namespace umbel::cluster
