// Boxes rounded to 15 bits a coordinate, sixteen bytes each, so that a union is one minimum:
// {low.xyz, low half of the tag, -high.xyz, high half of the tag}. The tag is an item's index;
// unions leave garbage in it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/simd/box4.hpp"

namespace umbel {

typedef int16_t ShortBox __attribute__((vector_size(16)));
typedef uint16_t UShort8 __attribute__((vector_size(16)));

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

inline uint32_t tag_of(ShortBox b) { return uint16_t(b[3]) | uint32_t(uint16_t(b[7])) << 16; }

/// The box where `holds` is 1, the empty one where it is 0.
inline ShortBox only_if(uint32_t holds, ShortBox box) {
  const int16_t all = static_cast<int16_t>(-static_cast<int>(holds));
  const ShortBox mask{all, all, all, all, all, all, all, all};
  return (box & mask) | (empty_short_box() & ~mask);
}

/// Two vectors of integers within 16 bits as one.
inline ShortBox pack(Int4 a, Int4 b) {
#if defined(__SSE2__)
  return ShortBox(_mm_packs_epi32(__m128i(a), __m128i(b)));
#else
  typedef int16_t Short4 __attribute__((vector_size(8)));
  return __builtin_shufflevector(__builtin_convertvector(a, Short4),
                                 __builtin_convertvector(b, Short4), 0, 1, 2, 3, 4, 5, 6, 7);
#endif
}

/// Twice the centre in lanes 0 to 2, and its negative in lanes 4 to 6. Saturates: for boxes whose
/// coordinates have signs.
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
inline ShortBox difference(ShortBox a, ShortBox b) { return ShortBox(UShort8(a) - UShort8(b)); }

/// The centre in lanes 0 to 2, of a box without negative coordinates.
inline UShort8 center_of(ShortBox b) { return (UShort8(b) - UShort8(swap_halves(b))) >> 1; }
/// One lane of it, of a box in memory.
inline uint16_t center_of(const ShortBox& b, int axis) {
  return static_cast<uint16_t>(static_cast<uint16_t>(b[axis] - b[axis + 4]) >> 1);
}
/// {low.xyz, -, -high.xyz, -} of centres, by the same operations as for boxes.
inline ShortBox centers_of(ShortBox box) {
  const ShortBox c = ShortBox(center_of(box));
  return __builtin_shufflevector(c, -c, 0, 1, 2, 3, 8, 9, 10, 11);
}

/// Products of unsigned lanes without their low 16 bits.
inline UShort8 multiply_high(UShort8 a, UShort8 b) {
#if defined(__SSE2__)
  return UShort8(_mm_mulhi_epu16(__m128i(a), __m128i(b)));
#else
  UShort8 high;
  for (int k = 0; k < 8; ++k) high[k] = static_cast<uint16_t>(uint32_t(a[k]) * b[k] >> 16);
  return high;
#endif
}

/// Extents in steps, as floats, in lanes 0 to 2.
inline Float4 steps_of(ShortBox b) {
  const UShort8 e = UShort8{} - (UShort8(b) + UShort8(swap_halves(b)));
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

/// An eighth of the area of the box after it has grown by two units, so that flat boxes count.
inline float box_area(ShortBox b) {
  constexpr int16_t kGrown = 2;
  const ShortBox two{kGrown, kGrown, kGrown, 0, 0, 0, 0, 0};
  const ShortBox mask{-1, -1, -1, 0, 0, 0, 0, 0};
  const UShort8 twice = UShort8(two) - (UShort8(b) + UShort8(swap_halves(b)));
  const ShortBox e = ShortBox(twice >> 1) & mask;
#if defined(__SSE2__)
  const __m128i turned = _mm_shufflelo_epi16(__m128i(e), _MM_SHUFFLE(3, 0, 2, 1));
  const __m128i pairs = _mm_madd_epi16(__m128i(e), turned);
  return static_cast<float>(
      _mm_cvtsi128_si32(_mm_add_epi32(pairs, _mm_shuffle_epi32(pairs, _MM_SHUFFLE(1, 1, 1, 1)))));
#else
  return static_cast<float>(int32_t(e[0]) * e[1] + int32_t(e[1]) * e[2] + int32_t(e[2]) * e[0]);
#endif
}

/// The grid that boxes are rounded to: `kSteps` steps along each side of a box, the first at -2^14.
struct ShortBoxGrid {
  static constexpr int kSteps = 32767, kFirst = -16384;

  Float4 origin, scale, unit;
  float longest;

  explicit ShortBoxGrid(const Box4& bounds) : origin(bounds.low), scale{}, unit{}, longest(0) {
    const Float4 extents = bounds.extents();
    for (int k = 0; k < 3; ++k) {
      const float extent = extents[k];
      longest = std::max(longest, extent);
      // Shorter sides have no reciprocal, and are as good as none.
      if (!(extent > 1e-30f)) continue;
      scale[k] = float(kSteps) / extent;
      unit[k] = extent / float(kSteps);
    }
  }

  ShortBox rounded(const Aabb& box, uint32_t tag) const {
    const Box4 b = Box4::load(box);
    const Float4 low = (b.low - origin) * scale;
    const Float4 high = (-b.negated_high - origin) * scale;
#if defined(__SSE2__)
    const __m128i first = _mm_set1_epi32(kFirst);
    const __m128i l = _mm_add_epi32(_mm_cvtps_epi32(__m128(low)), first);
    const __m128i h = _mm_sub_epi32(_mm_set1_epi32(-kFirst), _mm_cvtps_epi32(__m128(high)));
    __m128i packed = _mm_packs_epi32(l, h);
    packed = _mm_insert_epi16(packed, int(tag & 0xffffu), 3);
    return ShortBox(_mm_insert_epi16(packed, int(tag >> 16), 7));
#else
    ShortBox r;
    for (int k = 0; k < 3; ++k) {
      r[k] = int16_t(std::nearbyint(low[k]) + kFirst);
      r[k + 4] = int16_t(-kFirst - std::nearbyint(high[k]));
    }
    r[3] = int16_t(tag & 0xffffu);
    r[7] = int16_t(tag >> 16);
    return r;
#endif
  }
};

}  // namespace umbel
