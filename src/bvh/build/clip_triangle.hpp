// Clips a triangle at a plane across an axis: the boxes of its two parts.
#pragma once

#include <array>

#include "base/simd/box4.hpp"
#include "umbel/mesh.hpp"

namespace umbel::bvh {

struct Corners {
  std::array<Float4, 3> at;

  Corners(const MeshView& mesh, uint32_t triangle) {
    for (int k = 0; k < 3; ++k) {
      const Vec3& p = mesh.positions[mesh.triangles[triangle][k]];
      at[k] = Float4{p.x, p.y, p.z, 0};
    }
  }
};

inline Float4 magnitude(Float4 x) { return max4(x, -x); }

/// `v` with another value for an axis. To write one lane in memory and then read all four would
/// wait for the store.
inline Float4 with_lane(Float4 v, int axis, float value) {
  typedef int32_t Bits __attribute__((vector_size(16)));
  constexpr Bits kLanes[3] = {{-1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}};
  const Bits lane = kLanes[axis];
  return Float4((Bits(splat(value)) & lane) | (Bits(v) & ~lane));
}

/// Empty, with an extent below 0, where the boxes do not meet.
inline Box4 intersection(const Box4& a, const Box4& b) {
  return {max4(a.low, b.low), max4(a.negated_high, b.negated_high)};
}
inline bool is_empty(const Box4& b) {
#if defined(__SSE2__)
  return (_mm_movemask_ps(__m128(Float4(b.low > -b.negated_high))) & 7) != 0;
#else
  const Float4 e = b.extents();
  return e[0] < 0 || e[1] < 0 || e[2] < 0;
#endif
}

/// Where the edge from a to b crosses the plane, enlarged by what the arithmetic may be off.
inline Box4 crossing(Float4 a, Float4 b, int axis, float plane) {
  const Float4 along = b - a;
  const Float4 p = a + along * splat((plane - a[axis]) / along[axis]);
  const Float4 error = magnitude(along) * splat(6 * 0x1p-24f) + magnitude(p) * splat(0x1p-23f);
  return {p - error, -p - error};
}

/// What lies before and behind the plane, within `box`, which holds a part of the triangle. The
/// plane crosses the box.
inline void clip_triangle(const Corners& corners, const Box4& box, int axis, float plane,
                          Box4& before, Box4& behind) {
  before = behind = Box4::empty();
  for (int k = 0; k < 3; ++k) {
    const Float4 a = corners.at[k], b = corners.at[k == 2 ? 0 : k + 1];
    if (a[axis] <= plane) before.extend({a, -a});
    if (a[axis] >= plane) behind.extend({a, -a});
    if ((a[axis] < plane && plane < b[axis]) || (b[axis] < plane && plane < a[axis])) {
      const Box4 p = crossing(a, b, axis, plane);
      before.extend(p);
      behind.extend(p);
    }
  }
  before.negated_high = with_lane(before.negated_high, axis, -plane);
  behind.low = with_lane(behind.low, axis, plane);
  before = intersection(before, box);
  behind = intersection(behind, box);
}

}  // namespace umbel::bvh
