// The watertight ray-triangle test (Woop, Benthin & Wald 2013), one triangle at a time. SIMD
// forms do the same operations in the same order, so that results agree bit by bit. What this and
// the next headers define has internal linkage, because it is compiled for several instruction
// sets.
#pragma once

#include "bvh/ray_frame.hpp"

namespace umbel {

/// In double precision, where the product of two floats is exact: what float arithmetic calls
/// zero is decided here, the same way for both triangles of an edge.
struct ExactEdges {
  float u, v, w;
};
static inline ExactEdges exact_edges(float ax, float ay, float bx, float by, float cx, float cy) {
  const double u = double{cx} * by - double{cy} * bx;
  const double v = double{ax} * cy - double{ay} * cx;
  const double w = double{bx} * ay - double{by} * ax;
  return {static_cast<float>(u), static_cast<float>(v), static_cast<float>(w)};
}

/// v and w are those of Hit times `determinant`.
struct TriangleHit {
  float t, v, w, determinant;
};

/// The corners' coordinates along the frame's axes kx, ky, kz.
struct FrameTriangle {
  float a[3], b[3], c[3];
};

/// True where the ray's line meets the triangle; the interval is the caller's to check.
static inline bool test_triangle(const RayFrame& f, const FrameTriangle& triangle, bool cull_back,
                                 TriangleHit& hit) {
  const float ox = f.origin[f.kx], oy = f.origin[f.ky], oz = f.origin[f.kz];
  const float az = (triangle.a[2] - oz) * f.scale, bz = (triangle.b[2] - oz) * f.scale,
              cz = (triangle.c[2] - oz) * f.scale;
  const float ax = (triangle.a[0] - ox) * f.scale - f.sx * az;
  const float ay = (triangle.a[1] - oy) * f.scale - f.sy * az;
  const float bx = (triangle.b[0] - ox) * f.scale - f.sx * bz;
  const float by = (triangle.b[1] - oy) * f.scale - f.sy * bz;
  const float cx = (triangle.c[0] - ox) * f.scale - f.sx * cz;
  const float cy = (triangle.c[1] - oy) * f.scale - f.sy * cz;
  float u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
  if (u == 0.0f || v == 0.0f || w == 0.0f) {
    const ExactEdges edges = exact_edges(ax, ay, bx, by, cx, cy);
    u = edges.u;
    v = edges.v;
    w = edges.w;
  }
  const bool negative = u < 0.0f || v < 0.0f || w < 0.0f;
  if (negative && (cull_back || u > 0.0f || v > 0.0f || w > 0.0f)) return false;
  const float determinant = (u + v) + w;
  if (determinant == 0.0f) return false;
  const float depth = (u * az + v * bz) + w * cz;
  hit.t = (depth / determinant) * (f.sz * f.unscale);
  hit.v = v;
  hit.w = w;
  hit.determinant = determinant;
  return true;
}

/// False where the ray does not meet the triangle's own box (see ray_frame.hpp); else makes `t` no
/// less than where it does.
static inline bool settle(const RayFrame& f, const LeafTriangle& triangle, float& t) {
  const Quad a = {triangle.p0.x, triangle.p0.y, triangle.p0.z, 0};
  const Quad b = {triangle.p1.x, triangle.p1.y, triangle.p1.z, 0};
  const Quad c = {triangle.p2.x, triangle.p2.y, triangle.p2.z, 0};
  Quad low = a < b ? a : b, high = a > b ? a : b;
  low = c < low ? c : low;
  high = c > high ? c : high;
  Quad o, inv, near_b, far_b;
  std::memcpy(&o, f.origin, sizeof o);
  std::memcpy(&inv, f.inv, sizeof inv);
  std::memcpy(&near_b, f.near_b, sizeof near_b);
  std::memcpy(&far_b, f.far_b, sizeof far_b);
  constexpr float kShare = 6.0f / 16.0f / 2.0f;  // see ray_frame.hpp
  const Quad slack = (far_b - near_b) * kShare, one = (low - o) * inv, other = (high - o) * inv;
  const Quad enter = (one < other ? one : other) - slack,
             leave = (one > other ? one : other) + slack;
  const float entry = std::max(std::max(enter[0], enter[1]), enter[2]);
  const float exit = std::min(std::min(leave[0], leave[1]), leave[2]);
  t = std::max(t, entry);
  return entry <= exit && f.t_min <= exit;
}

}  // namespace umbel
