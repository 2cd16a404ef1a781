// Where items come from: boxes with centroids, or the triangles of a mesh, whose boxes are made
// when they are looked at.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>

#include "base/math.hpp"
#include "base/simd/box4.hpp"
#include "umbel/cluster.hpp"

namespace umbel::cluster {

/// Whether connections say which vertices items share. Where nothing is connected, no bit is
/// needed.
inline bool has_vertex_bits(const ClusterInput& input) {
  const Connections& c = input.connections;
  return input.item_vertices.empty() &&
         (!c.vertex_bits.empty() ||
          (input.vertices_per_item > 0 && !c.ranges.empty() && c.targets.empty()));
}

/// Of connection k. Vertex bits alone only count vertices.
inline float weight_of(const Connections& connections, uint32_t k) {
  if (!connections.weights.empty()) return connections.weights[k];
  return connections.vertex_bits.empty() ? 1.0f : 0.0f;
}

struct Source {
  static Source of(const ClusterInput& input) {
    Source s;
    s.boxes = input.boxes;
    s.centroids = input.centroids;
    s.connections = input.connections;
    s.vertices = input.item_vertices.empty() ? nullptr : input.item_vertices.data();
    if (s.vertices || has_vertex_bits(input)) s.arity = input.vertices_per_item;
    s.shared_vertex_weight = input.shared_vertex_weight;
    return s;
  }
  static Source of(const MeshView& mesh, float shared_vertex_weight) {
    Source s;
    s.positions = mesh.positions.data();
    s.vertices = reinterpret_cast<const uint32_t*>(mesh.triangles.data());
    s.arity = 3;
    s.vertex_count = mesh.positions.size();
    s.shared_vertex_weight = shared_vertex_weight;
    return s;
  }

  Aabb box(uint32_t item) const {
    if (!positions) return boxes[item];
    const uint32_t* t = vertices + size_t(item) * 3;
    const Vec3 &a = positions[t[0]], &b = positions[t[1]], &c = positions[t[2]];
    return {min(min(a, b), c), max(max(a, b), c)};
  }

  Box4 record(uint32_t item) const {
    if (!positions) return Box4::from(boxes[item]);
    const uint32_t* t = vertices + size_t(item) * 3;
    const Float4 a = load(positions[t[0]]), b = load(positions[t[1]]), c = load(positions[t[2]]);
    return {min4(min4(a, b), c), -max4(max4(a, b), c)};
  }

  /// Starts to bring an item closer, to be called some items before `prefetch_box` is.
  void prefetch(uint32_t item) const {
    __builtin_prefetch(positions ? static_cast<const void*>(vertices + size_t(item) * 3)
                                 : &boxes[item]);
  }
  void prefetch_vertices(uint32_t item) const {
    __builtin_prefetch(vertices + size_t(item) * arity);
  }
  /// The same for what the item refers to, to be called some items before its box is needed.
  void prefetch_box(uint32_t item) const {
    if (!positions) return;
    for (int k = 0; k < 3; ++k) __builtin_prefetch(&positions[vertices[size_t(item) * 3 + k]]);
  }

  /// {x, y, z, 0}, in two loads instead of three.
  static Float4 load(const Vec3& p) {
    typedef double Double2 __attribute__((vector_size(16)));
    double xy;
    memcpy(&xy, &p.x, sizeof xy);
    const Float4 low = std::bit_cast<Float4>(Double2{xy, 0.0});
    return __builtin_shufflevector(low, Float4{p.z, 0, 0, 0}, 0, 1, 4, 5);
  }

  std::span<const Aabb> boxes;
  std::span<const Vec3> centroids;
  Connections connections;
  const Vec3* positions = nullptr;
  const uint32_t* vertices = nullptr;  ///< `arity` an item, or null: connections have their bits
  uint32_t arity = 0;                  ///< 0: items have no vertices
  size_t vertex_count = SIZE_MAX;      ///< all vertices are below it
  float shared_vertex_weight = 0.0f;
};

}  // namespace umbel::cluster
