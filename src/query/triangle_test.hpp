// The watertight ray-triangle test in a ray's frame, and what settles a hit. What this and the next
// headers define has internal linkage, because it is compiled for several instruction sets.
#pragma once

#include "query/ray_frame.hpp"
#include "query/woop_triangle.hpp"

namespace umbel {

static inline bool test_triangle(const RayFrame& f, const FrameTriangle& triangle, bool cull_back,
                                 TriangleHit& hit) {
  return test_triangle(f, f.origin[f.kx], f.origin[f.ky], f.origin[f.kz], triangle, cull_back, hit);
}

/// By how much of the frame's error the interval of a triangle's own box is made wider at either
/// end: see ray_frame.hpp.
inline constexpr float kOwnBoxShare = 6.0f / 16.0f;

/// False where the ray does not meet the triangle's own box (see ray_frame.hpp); else makes `t` no
/// less than where it does.
static inline bool settle(const RayFrame& f, const LeafTriangle& triangle, float& t) {
  const Float4 a = {triangle.p0.x, triangle.p0.y, triangle.p0.z, 0};
  const Float4 b = {triangle.p1.x, triangle.p1.y, triangle.p1.z, 0};
  const Float4 c = {triangle.p2.x, triangle.p2.y, triangle.p2.z, 0};
  Float4 low = a < b ? a : b, high = a > b ? a : b;
  low = c < low ? c : low;
  high = c > high ? c : high;
  Float4 o, inv, error;
  std::memcpy(&o, f.origin, sizeof o);
  std::memcpy(&inv, f.inv, sizeof inv);
  std::memcpy(&error, f.error, sizeof error);
  const Float4 error_bound = error * kOwnBoxShare;
  const Float4 one = (low - o) * inv, other = (high - o) * inv;
  const Float4 enter = (one < other ? one : other) - error_bound,
               leave = (one > other ? one : other) + error_bound;
  const float entry = std::max(std::max(enter[0], enter[1]), enter[2]);
  const float exit = std::min(std::min(leave[0], leave[1]), leave[2]);
  t = std::max(t, entry);
  return entry <= exit && f.t_min <= exit;
}

}  // namespace umbel
