// Rays through a compact tree: the same hits, bit by bit, as those of TriangleQueries. The frame of
// a ray, the triangle test and what settles a hit are those of ray_frame.hpp and triangle_test.hpp,
// a number at a time, for processors and devices; ray_frame.hpp says why the order of visits makes
// no difference.
#pragma once

#include <cmath>

#include "base/math.hpp"
#include "bvh/compressed/compact_traverse.hpp"
#include "query/woop_triangle.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::bvh {

UMBEL_HOST_DEVICE inline float along(const Vec3& v, uint32_t axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}
UMBEL_HOST_DEVICE inline float larger(float a, float b) { return a < b ? b : a; }
UMBEL_HOST_DEVICE inline float smaller(float a, float b) { return b < a ? b : a; }

/// RayFrame, without vectors of the processor.
struct CompactFrame {
  float inv[3], near_b[3], far_b[3], error[3];
  Vec3 origin;
  float ox, oy, oz;  ///< the origin along Woop's axes
  float sx, sy, sz;
  uint32_t kx, ky, kz;
  float t_min, t_max, t_unit;
  float scale, unscale;

  UMBEL_HOST_DEVICE static float power_of_two(int exponent) {
    return std::bit_cast<float>(static_cast<uint32_t>(exponent + 127) << 23);
  }
  UMBEL_HOST_DEVICE static int exponent_of(float value) {
    return static_cast<int>(std::bit_cast<uint32_t>(value) >> 23 & 255u) - 127;
  }
  UMBEL_HOST_DEVICE static int clamp_exponent(int exponent) {
    return exponent < -126 ? -126 : exponent > 126 ? 126 : exponent;
  }

  /// False where the ray can hit nothing.
  UMBEL_HOST_DEVICE bool make(const CompactInfo& info, const Ray& ray) {
    constexpr float kMax = std::numeric_limits<float>::max();
    if (!is_finite(ray.origin) || !is_finite(ray.direction) || !(ray.t_min <= ray.t_max))
      return false;
    float d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
    float a[3], most[3];
    for (uint32_t k = 0; k < 3; ++k) {
      a[k] = std::fabs(d[k]);
      most[k] = std::fabs(along(ray.origin, k));
    }
    float largest = larger(larger(a[0], a[1]), a[2]);
    if (!(largest > 0.0f)) return false;
    add_tree(info, most);
    const float furthest = larger(larger(most[0], most[1]), most[2]);
    kz = a[0] > a[1] ? (a[0] > a[2] ? 0u : 2u) : (a[1] > a[2] ? 1u : 2u);
    origin = ray.origin;
    // A hit at a t that overflows is a miss.
    t_min = larger(ray.t_min, -kMax);
    t_max = smaller(ray.t_max, kMax);
    t_unit = 1.0f;
    const bool is_far = furthest > 0x1p66f;
    if (largest < 0x1p-20f || largest > 0x1p20f || is_far) {
      const int exponent = clamp_exponent(exponent_of(largest) - (is_far ? 40 : 0));
      t_unit = power_of_two(-exponent);
      const float inverse = power_of_two(exponent);
      t_min = larger(t_min * inverse, -kMax);
      t_max = smaller(t_max * inverse, kMax);
      for (uint32_t k = 0; k < 3; ++k) {
        d[k] *= t_unit;
        a[k] *= t_unit;
      }
      largest *= t_unit;
    }
    make_slabs(d, a, most, furthest, largest);
    make_shear(d);
    return true;
  }

 private:
  /// Sets the scale of triangles, and adds the tree to the largest coordinates of each axis.
  UMBEL_HOST_DEVICE void add_tree(const CompactInfo& info, float* most) {
    float furthest = 0;
    for (uint32_t k = 0; k < 3; ++k) {
      const float max_abs =
          larger(std::fabs(along(info.bounds.min, k)), std::fabs(along(info.bounds.max, k)));
      furthest = larger(furthest, max_abs);
      most[k] = larger(most[k], max_abs);
    }
    scale = unscale = 1;
    if (furthest > 0x1p20f || (furthest < 0x1p-20f && furthest > 0)) {
      scale = power_of_two(clamp_exponent(-exponent_of(furthest)));
      unscale = 1 / scale;
    }
  }
  UMBEL_HOST_DEVICE void make_slabs(const float* d, const float* a, const float* most,
                                    float furthest, float largest) {
    const float smallest = 0x1p-40f * largest;
    for (uint32_t k = 0; k < 3; ++k) {
      const float error_bound = most[k] * 0x1p-20f + furthest * 0x1p-38f;
      inv[k] = 1.0f / std::copysign(a[k] < smallest ? smallest : a[k], d[k]);
      error[k] = std::fabs(inv[k]) * error_bound;
      // Rounded once.
      const double b = -double{along(origin, k)} * double{inv[k]};
      near_b[k] = static_cast<float>(b - double{error[k]});
      far_b[k] = static_cast<float>(b + double{error[k]});
    }
  }
  UMBEL_HOST_DEVICE void make_shear(const float* d) {
    const Vec3 direction{d[0], d[1], d[2]};
    const uint32_t next = kz == 2 ? 0 : kz + 1, last = kz == 0 ? 2 : kz - 1;
    const bool is_negative = std::signbit(along(direction, kz));
    kx = is_negative ? last : next;
    ky = is_negative ? next : last;
    // The largest component is not too small, so this is its reciprocal.
    sz = kz == 0 ? inv[0] : kz == 1 ? inv[1] : inv[2];
    sx = along(direction, kx) * sz;
    sy = along(direction, ky) * sz;
    ox = along(origin, kx);
    oy = along(origin, ky);
    oz = along(origin, kz);
  }
};

/// test_triangle for a triangle of a leaf.
UMBEL_HOST_DEVICE inline bool meets(const CompactFrame& f, const CompactTriangle& t, bool cull_back,
                                    TriangleHit& hit) {
  const FrameTriangle corners{{along(t.p0, f.kx), along(t.p0, f.ky), along(t.p0, f.kz)},
                              {along(t.p1, f.kx), along(t.p1, f.ky), along(t.p1, f.kz)},
                              {along(t.p2, f.kx), along(t.p2, f.ky), along(t.p2, f.kz)}};
  return test_triangle(f, f.ox, f.oy, f.oz, corners, cull_back, hit);
}

/// settle of triangle_test.hpp: false where the ray does not meet the triangle's own box; else
/// makes `t` no less than where it does.
UMBEL_HOST_DEVICE inline bool settles(const CompactFrame& f, const CompactTriangle& triangle,
                                      float& t) {
  constexpr float kShare = 6.0f / 16.0f;
  float entry = 0, exit = 0;
  for (uint32_t k = 0; k < 3; ++k) {
    const float a = along(triangle.p0, k), b = along(triangle.p1, k), c = along(triangle.p2, k);
    float low = a < b ? a : b, high = a > b ? a : b;
    low = c < low ? c : low;
    high = c > high ? c : high;
    const float o = along(f.origin, k);
    const float error_bound = f.error[k] * kShare;
    const float one = (low - o) * f.inv[k], other = (high - o) * f.inv[k];
    const float enter = (one < other ? one : other) - error_bound;
    const float leave = (one > other ? one : other) + error_bound;
    entry = k == 0 ? enter : larger(entry, enter);
    exit = k == 0 ? leave : smaller(exit, leave);
  }
  t = larger(t, entry);
  return entry <= exit && f.t_min <= exit;
}

/// a * b + c, rounded once or twice.
UMBEL_HOST_DEVICE inline float multiply_add(float a, float b, float c) {
#if defined(__CUDA_ARCH__)
  return __fmaf_rn(a, b, c);
#else
  return a * b + c;
#endif
}

/// What rays see: triangles whose mask shares a bit with theirs.
struct CompactMasks {
  const uint32_t* of_primitives = nullptr;  ///< null: all bits set
  uint32_t of_rays = 0xffffffffu;

  UMBEL_HOST_DEVICE bool show(uint32_t primitive) const {
    return of_primitives == nullptr || (of_primitives[primitive] & of_rays) != 0;
  }
};

/// For those who do not measure.
struct CountNothing {
  UMBEL_HOST_DEVICE void count_triangle() {}
};

/// Finds the nearest hit, of equal ones that with the lowest primitive; or, with `any`, one at all.
template <bool any, typename Count = CountNothing>
class RayVisitor : public Count {
 public:
  /// False where the ray can hit nothing.
  UMBEL_HOST_DEVICE bool begin(const CompactTree& tree, const Ray& ray, bool cull_back,
                               const CompactMasks& masks = {}) {
    tree_ = tree;
    cull_back_ = cull_back;
    masks_ = masks;
    best_ = Hit{};
    if (masks.of_rays == 0 || tree.info->nodes == 0 || !frame_.make(*tree.info, ray)) return false;
    limit_ = frame_.t_max;
    octant_ = (frame_.inv[0] < 0 ? 1u : 0u) | (frame_.inv[1] < 0 ? 2u : 0u) |
              (frame_.inv[2] < 0 ? 4u : 0u);
    return true;
  }

  UMBEL_HOST_DEVICE float limit() const {
    // After the first of any hits, nothing is near enough.
    return any && is_hit() ? -std::numeric_limits<float>::infinity() : limit_;
  }

  UMBEL_HOST_DEVICE CompactGroup visit(const CompactNode& node) {
    float near = std::numeric_limits<float>::infinity();
    const uint32_t children = meet_children(node, near);
    if ((children & ~uint32_t{node.inner}) != 0)
      each_triangle(tree_, node, children, octant_,
                    [this](const CompactTriangle& triangle, uint32_t) { return take(triangle); });
    return CompactGroup::of(node, children, octant_, near);
  }

  UMBEL_HOST_DEVICE Hit result() const {
    Hit hit = best_;
    if (is_hit()) hit.t *= frame_.t_unit;
    return hit;
  }

 private:
  /// The children, by slot, whose boxes the ray meets within the limit, and where it meets the
  /// first.
  UMBEL_HOST_DEVICE uint32_t meet_children(const CompactNode& node, float& first) const {
    float enter[8], leave[8];
    for (uint32_t slot = 0; slot < 8; ++slot) {
      enter[slot] = frame_.t_min;
      leave[slot] = limit_;
    }
    for (uint32_t k = 0; k < 3; ++k) {
      // t of plane q is q (cell inv) + (origin inv + b), with more room than ray_frame.hpp leaves
      // for planes that are not on a grid: see widen_error_bounds in ray_traverse.hpp.
      const float more = frame_.error[k] * 0.5f;
      const float inv = frame_.inv[k];
      const float cell = compact_cell(node.exponent[k]) * inv;
      const float origin = along(node.origin, k) * inv;
      const float near_b = origin + (frame_.near_b[k] - more);
      const float far_b = origin + (frame_.far_b[k] + more);
      const uint64_t low = slots_of(node.low[k]), high = slots_of(node.high[k]);
      const uint64_t near_planes = inv < 0 ? high : low, far_planes = inv < 0 ? low : high;
      for (uint32_t slot = 0; slot < 8; ++slot) {
        const float a = multiply_add(static_cast<float>(slot_of(near_planes, slot)), cell, near_b);
        const float b = multiply_add(static_cast<float>(slot_of(far_planes, slot)), cell, far_b);
        enter[slot] = a > enter[slot] ? a : enter[slot];
        leave[slot] = b < leave[slot] ? b : leave[slot];
      }
    }
    uint32_t children = 0;
    const uint64_t meta = slots_of(node.meta);
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if (slot_of(meta, slot) == 0 || !(enter[slot] <= leave[slot])) continue;
      children |= 1u << slot;
      first = smaller(first, enter[slot]);
    }
    return children;
  }

  UMBEL_HOST_DEVICE bool take(const CompactTriangle& triangle) {
    this->count_triangle();
    TriangleHit hit;
    if (!meets(frame_, triangle, cull_back_, hit)) return true;
    float t = hit.t;
    if (!(t >= frame_.t_min && t <= limit_) || !settles(frame_, triangle, t)) return true;
    if (t > limit_ || (t == limit_ && is_hit() && triangle.primitive >= best_.primitive))
      return true;
    if (!masks_.show(triangle.primitive)) return true;
    limit_ = t;
    best_ = {t, triangle.primitive, hit.v / hit.determinant, hit.w / hit.determinant};
    return !any;
  }

  UMBEL_HOST_DEVICE bool is_hit() const { return best_.primitive != kNone; }

  CompactTree tree_;
  CompactFrame frame_;
  Hit best_;
  float limit_ = 0;
  uint32_t octant_ = 0;
  bool cull_back_ = false;
  CompactMasks masks_;
};

}  // namespace umbel::bvh
