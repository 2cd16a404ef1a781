// A ray made ready for box and triangle tests.
//
// Boxes (after Ize 2013). For a plane p of an axis, t = p * inv + b with b = -o * inv costs one
// multiplication and one addition, but its rounding error does not shrink with t: each of the
// four roundings (inv, b, product, sum) is at most 2^-24 of a value no larger than (|p| + |o|)
// |inv|. With E >= |p|, |o| for all planes and axes, |error| <= 4 * 2^-24 * 2 E |inv| = 2^-21 E
// |inv|. So b is moved by twice that away from the box, once for the near and once for the far
// planes, and no box that the exact ray meets is missed, for any sign of t. It amounts to boxes
// larger by 2^-20 E. A direction component smaller than 2^-40 of the largest is replaced by that:
// over the distance that matters the ray moves by less than 2^-38 E, within the same allowance,
// and no infinity arises.
//
// Triangles (Woop et al. 2013): axes are permuted so that the largest component of the direction
// is kz, and sheared so that the ray runs along it. The direction is first scaled by a power of
// two to about 1, and so are the coordinates of trees of extreme size, so that nothing under- or
// overflows.
#pragma once

#include <bit>
#include <cmath>

#include "bvh/triangle_bvh_data.hpp"

namespace umbel {

struct RayFrame {
  float inv[3], near_b[3], far_b[3];
  float origin[3];
  float sx, sy, sz;    ///< Woop's shear
  int kx, ky, kz;      ///< Woop's axes
  float t_min, t_max;  /// in units of the scaled direction
  float t_unit;        ///< what t is to be multiplied by to give the ray's own
  float scale;         ///< what triangles are multiplied by: a power of two
  float unscale;       ///< 1 / scale
};

/// Hits closer together than this fraction may come from boxes in either order: culling keeps
/// them all, so that a tie is broken by primitive and not by the tree.
inline constexpr float kTieSlack = 1.0f / (1 << 18);

static inline float cull_distance(float t) { return t + std::fabs(t) * kTieSlack; }

static inline float power_of_two(int exponent) {
  return std::bit_cast<float>(static_cast<uint32_t>(exponent + 127) << 23);
}
/// Of a finite value; -127 for zero and denormals.
static inline int exponent_of(float value) {
  return static_cast<int>((std::bit_cast<uint32_t>(value) >> 23) & 255u) - 127;
}

/// False where the ray can hit nothing.
static inline bool make_frame(const TriangleBvhData& tree, const Ray& ray, RayFrame& f) {
  constexpr float kMax = std::numeric_limits<float>::max();
  float d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  const float o[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
  const float a[3] = {std::fabs(d[0]), std::fabs(d[1]), std::fabs(d[2])};
  const int kz = a[0] > a[1] ? (a[0] > a[2] ? 0 : 2) : (a[1] > a[2] ? 1 : 2);
  float largest = a[kz];
  const float sum = a[0] + a[1] + a[2] + std::fabs(o[0]) + std::fabs(o[1]) + std::fabs(o[2]);
  // Written so that a NaN anywhere fails.
  if (!(sum <= kMax) || !(largest > 0.0f) || !(ray.t_min <= ray.t_max)) return false;

  f.t_min = ray.t_min;
  f.t_max = ray.t_max;
  f.t_unit = 1.0f;
  if (largest < 0x1p-20f || largest > 0x1p20f) {
    const int exponent = std::min(std::max(exponent_of(largest), -126), 126);
    f.t_unit = power_of_two(-exponent);
    const float inverse = power_of_two(exponent);
    f.t_min *= inverse;
    f.t_max *= inverse;
    for (float& component : d) component *= f.t_unit;
    largest *= f.t_unit;
  }

  const float reach =
      std::max(tree.reach, std::max(std::fabs(o[0]), std::max(std::fabs(o[1]), std::fabs(o[2]))));
  const float slack = 0x1p-20f * reach, smallest = 0x1p-40f * largest;
  for (int axis = 0; axis < 3; ++axis) {
    const float component =
        std::fabs(d[axis]) < smallest ? std::copysign(smallest, d[axis]) : d[axis];
    f.inv[axis] = 1.0f / component;
    const float b = -o[axis] * f.inv[axis], e = slack * std::fabs(f.inv[axis]);
    f.near_b[axis] = b - e;
    f.far_b[axis] = b + e;
    f.origin[axis] = o[axis];
  }
  f.kz = kz;
  // The other two in the order that keeps a triangle's winding.
  const int next = kz == 2 ? 0 : kz + 1, last = kz == 0 ? 2 : kz - 1;
  const bool flip = d[kz] < 0.0f;
  f.kx = flip ? last : next;
  f.ky = flip ? next : last;
  f.sz = 1.0f / d[kz];
  f.sx = d[f.kx] * f.sz;
  f.sy = d[f.ky] * f.sz;
  f.scale = tree.scale;
  f.unscale = 1.0f / tree.scale;
  return true;
}

}  // namespace umbel
