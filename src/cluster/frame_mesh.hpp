// What the algorithms for meshes that change every frame take and give: raw pointers into an
// executor's memory.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/math.hpp"

namespace umbel::cluster {

/// Vertex positions, possibly within larger vertices.
struct Positions {
  const char* first;
  size_t stride;  ///< in bytes

  UMBEL_HOST_DEVICE Vec3 operator[](uint32_t vertex) const {
    const auto* p = reinterpret_cast<const float*>(first + vertex * stride);
    return {p[0], p[1], p[2]};
  }
};

struct FrameMesh {
  Positions positions;
  const Triangle* triangles;
  const uint32_t* items;  ///< what each triangle is called; null: by its place
  uint32_t count;         ///< triangles, or where that is known on the device only, the most
  const uint32_t* actual = nullptr;  ///< how many there are, if not `count`

  UMBEL_HOST_DEVICE uint32_t size() const { return actual ? *actual : count; }
  UMBEL_HOST_DEVICE Aabb box(uint32_t place) const {
    const Triangle& t = triangles[place];
    const Vec3 a = positions[t[0]], b = positions[t[1]], c = positions[t[2]];
    return {min(min(a, b), c), max(max(a, b), c)};
  }
  UMBEL_HOST_DEVICE uint32_t item(uint32_t place) const { return items ? items[place] : place; }
};

/// Clusters as arrays. Cluster c has the triangles [offsets[c], offsets[c + 1]).
struct FrameClusters {
  uint32_t* items;      ///< one a triangle, in cluster order
  Triangle* triangles;  ///< the same triangles: a new index buffer
  uint32_t* offsets;    ///< one more than clusters
  Aabb* boxes;          ///< one a cluster
  uint32_t* count;      ///< clusters
};

struct UniteBoxes {
  UMBEL_HOST_DEVICE Aabb operator()(Aabb a, const Aabb& b) const {
    extend(a, b);
    return a;
  }
};

/// The same box with positive zeros: which of two equal zeros a minimum gives depends on the order.
UMBEL_HOST_DEVICE inline Aabb with_positive_zeros(const Aabb& box) {
  const Vec3 zero{0, 0, 0};
  return {box.min + zero, box.max + zero};
}

}  // namespace umbel::cluster
