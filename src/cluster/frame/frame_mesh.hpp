// The input and output of the algorithms for meshes that change every frame: raw pointers into an
// executor's memory.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/math.hpp"
#if defined(__SSE2__) && !defined(__CUDACC__)
#define UMBEL_BOX_VECTORS 1
#include "cluster/source.hpp"
#else
#define UMBEL_BOX_VECTORS 0
#endif

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
  const uint32_t* items;  ///< the name of each triangle; null: its index
  uint32_t count;         ///< triangles, or where that is known on the device only, the most
  const uint32_t* actual = nullptr;  ///< how many there are, if not `count`

  UMBEL_HOST_DEVICE uint32_t size() const { return actual ? *actual : count; }
  UMBEL_HOST_DEVICE Aabb box(uint32_t triangle) const {
    const Triangle& t = triangles[triangle];
    const Vec3 a = positions[t[0]], b = positions[t[1]], c = positions[t[2]];
    return {min(min(a, b), c), max(max(a, b), c)};
  }
  UMBEL_HOST_DEVICE uint32_t item(uint32_t triangle) const {
    return items ? items[triangle] : triangle;
  }

#if UMBEL_BOX_VECTORS
  /// The same box, in a third of the instructions.
  Box4 record(uint32_t triangle) const {
    const Triangle& t = triangles[triangle];
    const Float4 a = load(t[0]), b = load(t[1]), c = load(t[2]);
    return {min4(min4(a, b), c), -max4(max4(a, b), c)};
  }
  /// Starts to bring a triangle closer, to be called some before `prefetch_box` is.
  void prefetch(uint32_t triangle) const { __builtin_prefetch(&triangles[triangle]); }
  void prefetch_box(uint32_t triangle) const {
    for (const uint32_t v : triangles[triangle])
      __builtin_prefetch(positions.first + v * positions.stride);
  }

 private:
  Float4 load(uint32_t v) const {
    return Source::load(*reinterpret_cast<const Vec3*>(positions.first + v * positions.stride));
  }
#endif
};

#if UMBEL_BOX_VECTORS
inline Aabb box_of(const Box4& r) {
  return {{r.low[0], r.low[1], r.low[2]},
          {-r.negated_high[0], -r.negated_high[1], -r.negated_high[2]}};
}
#endif

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

/// The box around the triangles at indices[0, count), by a team. Calls visit(i) for each on the
/// way.
template <typename Team, typename Visit>
UMBEL_HOST_DEVICE Aabb gather_box(const Team& team, const FrameMesh& mesh, const uint32_t* indices,
                                  uint32_t count, const Visit& visit) {
#if UMBEL_BOX_VECTORS
  if constexpr (Team::kIsSerial) {
    constexpr uint32_t kAhead = 16;
    Box4 box = Box4::empty();
    for (uint32_t i = 0; i < count; ++i) {
      // Of the next cluster too, which lies behind; never past the last triangle.
      if (i + 2 * kAhead < count) mesh.prefetch(indices[i + 2 * kAhead]);
      if (i + kAhead < count) mesh.prefetch_box(indices[i + kAhead]);
      visit(i);
      box.extend(mesh.record(indices[i]));
    }
    return box_of(box);
  }
#endif
  Aabb box;
  for (uint32_t i = team.rank(); i < count; i += team.size()) {
    visit(i);
    extend(box, mesh.box(indices[i]));
  }
  return team.reduce(box, UniteBoxes{});
}

}  // namespace umbel::cluster
