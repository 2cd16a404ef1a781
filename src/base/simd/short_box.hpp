// Boxes rounded to 15 bits a coordinate, sixteen bytes each, so that a union is one minimum:
// {low.xyz, low half of the tag, -high.xyz, high half of the tag}. The tag is a primitive's index;
// unions leave garbage there.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/simd/box4.hpp"

namespace umbel::bvh {

typedef int16_t ShortBox __attribute__((vector_size(16)));
typedef uint16_t WrappingBox __attribute__((vector_size(16)));
typedef int32_t Int4 __attribute__((vector_size(16)));

inline constexpr int kShortSteps = 32767;
inline constexpr int kShortFirst = -16384;

inline ShortBox empty_short_box() {
  constexpr int16_t kBig = 32767;
  return ShortBox{kBig, kBig, kBig, kBig, kBig, kBig, kBig, kBig};
}

inline ShortBox join(ShortBox a, ShortBox b) {
#if defined(__SSE2__)
  return ShortBox(_mm_min_epi16(__m128i(a), __m128i(b)));
#else
  return a < b ? a : b;
#endif
}

inline ShortBox swap_halves(ShortBox b) {
#if defined(__SSE2__)
  return ShortBox(_mm_shuffle_epi32(__m128i(b), 0x4e));
#else
  return __builtin_shufflevector(b, b, 4, 5, 6, 7, 0, 1, 2, 3);
#endif
}

/// Twice the centre in lanes 0 to 2, and its negative in lanes 4 to 6.
inline ShortBox center2(ShortBox b) {
#if defined(__SSE2__)
  return ShortBox(_mm_subs_epi16(__m128i(b), __m128i(swap_halves(b))));
#else
  const ShortBox s = swap_halves(b);
  ShortBox c;
  for (int k = 0; k < 8; ++k) c[k] = int16_t(std::clamp(int(b[k]) - int(s[k]), -32768, 32767));
  return c;
#endif
}

/// a - b modulo 2^16.
inline ShortBox difference(ShortBox a, ShortBox b) {
  return ShortBox(WrappingBox(a) - WrappingBox(b));
}

/// The high halves of the products, without signs.
inline ShortBox multiply_high(ShortBox a, ShortBox b) {
#if defined(__SSE2__)
  return ShortBox(_mm_mulhi_epu16(__m128i(a), __m128i(b)));
#else
  ShortBox h;
  for (int k = 0; k < 8; ++k) h[k] = int16_t((uint32_t(uint16_t(a[k])) * uint16_t(b[k])) >> 16);
  return h;
#endif
}

inline uint32_t tag_of(ShortBox b) { return uint16_t(b[3]) | uint32_t(uint16_t(b[7])) << 16; }

/// Extents in steps, as floats, in lanes 0 to 2.
inline Float4 steps_of(ShortBox b) {
  const WrappingBox e = WrappingBox{} - (WrappingBox(b) + WrappingBox(swap_halves(b)));
#if defined(__SSE2__)
  return Float4(_mm_cvtepi32_ps(_mm_unpacklo_epi16(__m128i(e), _mm_setzero_si128())));
#else
  return Float4{float(e[0]), float(e[1]), float(e[2]), 0};
#endif
}

/// Half the areas of three boxes with these extents, in lanes 0 to 2.
inline Float4 half_areas(Float4 a, Float4 b, Float4 c) {
  const Float4 ab = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 ab_z = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Float4 x = __builtin_shufflevector(ab, c, 0, 1, 4, 5);
  const Float4 y = __builtin_shufflevector(ab, c, 2, 3, 5, 5);
  const Float4 z = __builtin_shufflevector(ab_z, c, 0, 1, 6, 6);
  return x * y + z * (x + y);
}

/// The grid that boxes are rounded to: `kShortSteps` steps along each side of a box.
struct Frame {
  Float4 origin, scale, unit;
  float longest;

  explicit Frame(const Box4& bounds) : origin(bounds.low), scale{}, unit{}, longest(0) {
    const Float4 extents = bounds.extents();
    for (int k = 0; k < 3; ++k) {
      const float extent = extents[k];
      longest = std::max(longest, extent);
      // Shorter sides have no reciprocal, and are as good as none.
      if (!(extent > 1e-30f)) continue;
      scale[k] = float(kShortSteps) / extent;
      unit[k] = extent / float(kShortSteps);
    }
  }

  ShortBox rounded(const Aabb& box, uint32_t tag) const {
    const Box4 b = Box4::load(box);
    const Float4 low = (b.low - origin) * scale;
    const Float4 high = (-b.negated_high - origin) * scale;
#if defined(__SSE2__)
    const __m128i first = _mm_set1_epi32(kShortFirst);
    const __m128i l = _mm_add_epi32(_mm_cvtps_epi32(__m128(low)), first);
    const __m128i h = _mm_sub_epi32(_mm_set1_epi32(-kShortFirst), _mm_cvtps_epi32(__m128(high)));
    __m128i packed = _mm_packs_epi32(l, h);
    packed = _mm_insert_epi16(packed, int(tag & 0xffffu), 3);
    return ShortBox(_mm_insert_epi16(packed, int(tag >> 16), 7));
#else
    ShortBox r;
    for (int k = 0; k < 3; ++k) {
      r[k] = int16_t(std::nearbyint(low[k]) + kShortFirst);
      r[k + 4] = int16_t(-kShortFirst - std::nearbyint(high[k]));
    }
    r[3] = int16_t(tag & 0xffffu);
    r[7] = int16_t(tag >> 16);
    return r;
#endif
  }
};

}  // namespace umbel::bvh
