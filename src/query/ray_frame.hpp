// A ray made ready for box and triangle tests.
//
// Boxes (after Ize 2013). For a plane p of an axis, t = p * inv + b with b = -o * inv costs one
// multiplication and one addition, but its rounding error does not shrink with t. With u = 2^-24
// and E >= |p|, |o| for all planes of the axis, the product, the sum and b are off by at most 4 u E
// |inv| together. (That inv is rounded scales all t alike.) So b is moved by 16 u E |inv| away from
// the box, once for the near and once for the far planes: no box that the exact ray meets is
// missed, for any sign of t. It amounts to boxes larger by 2^-20 E. More would cost time: rays that
// start just above a wall would start in the boxes of that wall. A direction component smaller than
// 2^-40 of the largest is replaced by that, so that no infinity arises: over the distance that
// matters the ray moves by less than 2^-38 of the largest E of the three axes, by which boxes are
// larger, too.
//
// A triangle seen on edge has no sharp t, and one without area may even be said to be hit beside
// its corners. So a hit has to meet the triangle's own box, too, in an interval that is wider by
// 6 u E |inv|, which is what its own rounding may be off by, and its t is no less than where that
// begins (see settle). As 6 + 6 + 4 = 16, all boxes around it are then met no later than the hit:
// which there are, and in which order they come, makes no difference to what is hit and where.
//
// Triangles (Woop et al. 2013): axes are permuted so that the largest component of the direction
// is kz, and sheared so that the ray runs along it. The direction is first scaled by a power of
// two to about 1, and so are the coordinates of trees of extreme size, so that nothing under- or
// overflows. Where coordinates are so large that p * inv could overflow, the direction is scaled
// to 2^40 instead, so that |inv| <= 1.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/simd/float4.hpp"
#include "query/leaf_store.hpp"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace umbel {

typedef double Double4 __attribute__((vector_size(32)));

struct RayFrame {
  // Of x, y and z; the fourth lane means nothing.
  alignas(16) float inv[4];
  alignas(16) float near_b[4];
  alignas(16) float far_b[4];
  alignas(16) float error[4];  ///< 16 u E |inv|, see above
  alignas(16) float origin[4];
  float sx, sy, sz;     ///< Woop's shear
  uint32_t kx, ky, kz;  ///< Woop's axes
  uint32_t negative;    ///< bit i is set where inv[i] < 0
  float t_min, t_max;   /// in units of the scaled direction
  float t_unit;         ///< t times this is the ray's own
  float scale;          ///< what triangles are multiplied by: a power of two
  float unscale;        ///< 1 / scale
};

static inline float power_of_two(int exponent) {
  return std::bit_cast<float>(static_cast<uint32_t>(exponent + 127) << 23);
}
/// Of a finite value; -127 for zero and denormals.
static inline int exponent_of(float value) {
  return static_cast<int>((std::bit_cast<uint32_t>(value) >> 23) & 255u) - 127;
}

/// The axis of the largest component, by whether x exceeds y (bit 0), x exceeds z, y exceeds z.
inline constexpr uint8_t kLargestAxis[8] = {2, 2, 2, 0, 1, 2, 1, 0};

/// kx and ky for kz, in the order that keeps a triangle's winding for positive directions; the
/// other way around for negative ones. Tables, because branches on directions are often
/// mispredicted.
inline constexpr uint8_t kOtherAxes[3][2] = {{1, 2}, {2, 0}, {0, 1}};

static inline uint32_t sign_bits(Float4 lanes) {
#if defined(__SSE2__)
  return static_cast<uint32_t>(_mm_movemask_ps(lanes));
#else
  uint32_t bits = 0;
  for (uint32_t i = 0; i < 4; ++i) bits |= (std::bit_cast<uint32_t>(lanes[i]) >> 31) << i;
  return bits;
#endif
}

/// Lane by lane, of floats that are not negative: they compare as integers do, which is faster.
static inline Float4 larger(Float4 a, Float4 b) {
  return Float4(Int4(a) > Int4(b) ? Int4(a) : Int4(b));
}
/// The largest of the first three lanes, in all lanes.
static inline Float4 largest_of(Float4 a) {
  const Float4 b = larger(a, __builtin_shufflevector(a, a, 1, 2, 0, 0));
  return larger(b, __builtin_shufflevector(a, a, 2, 0, 1, 1));
}

/// False where the ray can hit nothing. Long, because its values stay in vector registers.
static inline bool make_frame(const LeafStore& tree, const Ray& ray, RayFrame& f) {
  constexpr float kMax = std::numeric_limits<float>::max();
  // Number by number: a ray that was just written so cannot be read as one vector yet.
  const Float4 o = {ray.origin.x, ray.origin.y, ray.origin.z, 0};
  Float4 d = {ray.direction.x, ray.direction.y, ray.direction.z, 1};
  constexpr int32_t kSign = std::numeric_limits<int32_t>::min();
  const Int4 signs = Int4(d) & kSign;
  Float4 a = Float4(Int4(d) & ~kSign);
  const Float4 away = Float4(Int4(o) & ~kSign);
  Float4 most;
  std::memcpy(&most, tree.max_abs_coord, sizeof most);
  most = larger(most, away);
  const Float4 furthest = largest_of(most);
  Float4 largest = largest_of(a);
  if (!(ray.t_min <= ray.t_max)) return false;
  const Float4 firsts = __builtin_shufflevector(a, a, 0, 0, 1, 3);
  const Float4 seconds = __builtin_shufflevector(a, a, 1, 2, 2, 3);
  const uint32_t kz = kLargestAxis[sign_bits(Float4(firsts > seconds))];

  // A hit at a t that overflows is a miss. -0 becomes 0, so that distances compare as integers.
  f.t_min = std::max(ray.t_min, -kMax) + 0.0f;
  f.t_max = std::min(ray.t_max, kMax);
  f.t_unit = 1.0f;
  // Written so that a NaN anywhere, which is the largest of all, comes here and fails.
  const bool is_far = !(furthest[0] <= 0x1p66f);
  if (!(largest[0] >= 0x1p-20f && largest[0] <= 0x1p20f) || is_far) [[unlikely]] {
    if (!(largest[0] > 0.0f && largest[0] <= kMax && furthest[0] <= kMax)) return false;
    const int wanted = exponent_of(largest[0]) - (is_far ? 40 : 0);
    const int exponent = std::min(std::max(wanted, -126), 126);
    f.t_unit = power_of_two(-exponent);
    const float inverse = power_of_two(exponent);
    f.t_min = std::max(f.t_min * inverse, -kMax);
    f.t_max = std::min(f.t_max * inverse, kMax);
    d *= f.t_unit;
    a *= f.t_unit;
    largest *= f.t_unit;
  }

  const Float4 error_bound = most * 0x1p-20f + furthest * 0x1p-38f;
  const Float4 component = Float4(Int4(larger(a, largest * 0x1p-40f)) | signs);
  const Float4 inv = 1.0f / component, e = Float4(Int4(inv) & ~kSign) * error_bound;
  // Rounded once.
#if defined(UMBEL_FMA)
  const Float4 near_b = _mm_fnmsub_ps(o, inv, e), far_b = _mm_fnmadd_ps(o, inv, e);
#else
  const Double4 b = __builtin_convertvector(o, Double4) * __builtin_convertvector(inv, Double4);
  const Double4 wide_e = __builtin_convertvector(e, Double4);
  const Float4 near_b = __builtin_convertvector(-wide_e - b, Float4);
  const Float4 far_b = __builtin_convertvector(wide_e - b, Float4);
#endif
  std::memcpy(f.error, &e, sizeof e);
  std::memcpy(f.inv, &inv, sizeof inv);
  std::memcpy(f.near_b, &near_b, sizeof near_b);
  std::memcpy(f.far_b, &far_b, sizeof far_b);
  std::memcpy(f.origin, &o, sizeof o);
  alignas(16) float directions[4];
  std::memcpy(directions, &d, sizeof d);
  f.negative = sign_bits(inv);
  const uint32_t is_negative = (f.negative >> kz) & 1;
  f.kx = kOtherAxes[kz][is_negative];
  f.ky = kOtherAxes[kz][1 - is_negative];
  f.kz = kz;
  // The largest component is not too small, so this is its reciprocal.
  f.sz = f.inv[kz];
  f.sx = directions[f.kx] * f.sz;
  f.sy = directions[f.ky] * f.sz;
  f.scale = tree.scale;
  f.unscale = tree.unscale;
  return true;
}

/// Where a ray enters a box, or infinity where it does not meet it in [t_min, t_max]. In units of
/// the scaled direction.
static inline float box_entry(const RayFrame& f, const Aabb& box, float t_max) {
  float near = f.t_min, far = t_max;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const float low = component(box.min, axis), high = component(box.max, axis);
    const bool flip = f.inv[axis] < 0.0f;
    const float enter = (flip ? high : low) * f.inv[axis] + f.near_b[axis];
    const float leave = (flip ? low : high) * f.inv[axis] + f.far_b[axis];
    near = enter > near ? enter : near;
    far = leave < far ? leave : far;
  }
  return near <= far ? near : std::numeric_limits<float>::infinity();
}

}  // namespace umbel
