// A quadratic function of a point of space, and sums of such (Garland & Heckbert 1997).
#pragma once

#include "base/math.hpp"

namespace umbel::lod {

/// v A v + 2 b v + c of the vector v from the point that it belongs to, which keeps its precision
/// where coordinates are large.
struct alignas(16) Quadric {
  float xx, yy, zz, xy;
  float xz, yz, weight, c;
  float x, y, z;
  float scale;  ///< for whoever keeps it
};

/// `weight` times the squared distance from the plane through the origin with the unit normal `n`.
inline void add_plane(Quadric& q, const Vec3& n, float weight) {
  q.xx += weight * n.x * n.x;
  q.yy += weight * n.y * n.y;
  q.zz += weight * n.z * n.z;
  q.xy += weight * n.x * n.y;
  q.xz += weight * n.x * n.z;
  q.yz += weight * n.y * n.z;
}

inline void add(Quadric& sum, const Quadric& q) {
  sum.xx += q.xx, sum.yy += q.yy, sum.zz += q.zz, sum.xy += q.xy;
  sum.xz += q.xz, sum.yz += q.yz, sum.weight += q.weight, sum.c += q.c;
  sum.x += q.x, sum.y += q.y, sum.z += q.z;
}

inline Vec3 times(const Quadric& q, const Vec3& d) {
  return {q.xx * d.x + q.xy * d.y + q.xz * d.z, q.xy * d.x + q.yy * d.y + q.yz * d.z,
          q.xz * d.x + q.yz * d.y + q.zz * d.z};
}

inline float value_at(const Quadric& q, const Vec3& d) {
  const Vec3 m = times(q, d);
  return q.c + (m.x + 2.0f * q.x) * d.x + (m.y + 2.0f * q.y) * d.y + (m.z + 2.0f * q.z) * d.z;
}

/// Adds `q`, whose origin becomes the point `d` away, where its value is `value`.
inline void add_moved(Quadric& sum, const Quadric& q, const Vec3& d, float value) {
  const Vec3 m = times(q, d);
  sum.xx += q.xx, sum.yy += q.yy, sum.zz += q.zz;
  sum.xy += q.xy, sum.xz += q.xz, sum.yz += q.yz;
  sum.x += q.x + m.x, sum.y += q.y + m.y, sum.z += q.z + m.z;
  sum.c += value;
  sum.weight += q.weight;
}

}  // namespace umbel::lod
