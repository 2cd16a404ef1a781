// The watertight ray-triangle test (Woop, Benthin & Wald 2013), one triangle at a time, on
// processors and devices. SIMD forms do the same operations in the same order, so that results
// agree bit by bit. It has internal linkage, because it is compiled for several instruction sets.
#pragma once

#include "base/host_device.hpp"

namespace umbel {

/// In double precision, where the product of two floats is exact: what float arithmetic calls
/// zero is decided here, the same way for both triangles of an edge.
struct ExactEdges {
  float u, v, w;
};
UMBEL_HOST_DEVICE static inline ExactEdges exact_edges(float ax, float ay, float bx, float by,
                                                       float cx, float cy) {
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

/// True where the ray's line meets the triangle; the interval is the caller's to check. Of the
/// frame, its shear and scale are used; (ox, oy, oz) is its origin along its axes.
template <typename Frame>
UMBEL_HOST_DEVICE static inline bool test_triangle(const Frame& f, float ox, float oy, float oz,
                                                   const FrameTriangle& triangle, bool cull_back,
                                                   TriangleHit& hit) {
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

}  // namespace umbel
