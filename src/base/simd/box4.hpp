// A box as two vectors of four floats, {min.xyz, 0} and {-max.xyz, 0}, so that a union is two
// minimums.
#pragma once

#include <cstdint>
#include <cstring>
#include <limits>

#include "umbel/bvh.hpp"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace umbel::bvh {

/// Four floats on which arithmetic works lane by lane (an extension of GCC and Clang).
typedef float Float4 __attribute__((vector_size(16)));

typedef int32_t Int4 __attribute__((vector_size(16)));

inline Float4 load4(const float* p) {
  Float4 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline Float4 splat(float x) { return Float4{x, x, x, x}; }
inline Float4 min4(Float4 a, Float4 b) {
#if defined(__SSE2__)
  return Float4(_mm_min_ps(__m128(a), __m128(b)));
#else
  return a < b ? a : b;
#endif
}

struct Box4 {
  Float4 low;
  Float4 negated_high;

  static Box4 empty() {
    constexpr float kBig = std::numeric_limits<float>::max();
    return {splat(kBig), splat(kBig)};
  }
  static Box4 from(const Aabb& b) {
    return {Float4{b.min.x, b.min.y, b.min.z, 0}, Float4{-b.max.x, -b.max.y, -b.max.z, 0}};
  }
  /// The same but for lane 3, which has no meaning then.
  static Box4 load(const Aabb& b) {
#if defined(__SSE2__)
    static_assert(sizeof(Aabb) == 24);
    const __m128 z_and_max = _mm_loadu_ps(&b.min.z);
    return {Float4(_mm_loadu_ps(&b.min.x)),
            -Float4(_mm_shuffle_ps(z_and_max, z_and_max, _MM_SHUFFLE(0, 3, 2, 1)))};
#else
    return from(b);
#endif
  }
  void extend(const Box4& o) {
    low = min4(low, o.low);
    negated_high = min4(negated_high, o.negated_high);
  }
  Float4 extents() const { return -(low + negated_high); }
  /// Twice the centre.
  Float4 center2() const { return low - negated_high; }

  /// Half the area of the box after it has grown by `pad`. A little padding makes boxes without
  /// area, those of points on one line, comparable by their length.
  float half_area(Float4 pad) const {
    const Float4 e = extents() + pad;
    const Float4 p = e * __builtin_shufflevector(e, e, 1, 2, 0, 3);
    return p[0] + p[1] + p[2];
  }
  /// Padding that is far below what the extents can resolve.
  Float4 pad() const {
    const Float4 e = extents();
    const float longest = e[0] > e[1] ? (e[0] > e[2] ? e[0] : e[2]) : (e[1] > e[2] ? e[1] : e[2]);
    return splat(longest * 0x1p-22f);
  }
  Node node(uint32_t first, uint32_t count) const {
    return {{low[0], low[1], low[2]},
            first,
            {-negated_high[0], -negated_high[1], -negated_high[2]},
            count};
  }
};

}  // namespace umbel::bvh
