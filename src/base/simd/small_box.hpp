// Boxes rounded to 15 bits a coordinate, sixteen bytes each, so that a union is one minimum:
// {low.xyz, low half of the tag, -high.xyz, high half of the tag}. Unions leave garbage in the tag.
#pragma once

#include <array>
#include <cstdint>

#include "base/simd/box_record.hpp"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace umbel::cluster {

typedef int16_t SmallBox __attribute__((vector_size(16)));
typedef uint16_t Center8 __attribute__((vector_size(16)));

inline constexpr float kSmallBoxLast = 32767.0f;

inline SmallBox empty_small_box() {
  constexpr int16_t kBig = 32767;
  return SmallBox{kBig, kBig, kBig, kBig, kBig, kBig, kBig, kBig};
}
inline SmallBox join(SmallBox a, SmallBox b) { return a < b ? a : b; }
/// The box where `holds` is 1, the empty one where it is 0.
inline SmallBox only_if(uint32_t holds, SmallBox box) {
  const int16_t all = static_cast<int16_t>(-static_cast<int>(holds));
  const SmallBox mask{all, all, all, all, all, all, all, all};
  return (box & mask) | (empty_small_box() & ~mask);
}
inline SmallBox swap_halves(SmallBox b) {
  return __builtin_shufflevector(b, b, 4, 5, 6, 7, 0, 1, 2, 3);
}

/// Two vectors of integers within 16 bits as one.
inline SmallBox pack(Int4 a, Int4 b) {
#if defined(__SSE2__)
  return SmallBox(_mm_packs_epi32(__m128i(a), __m128i(b)));
#else
  typedef int16_t Short4 __attribute__((vector_size(8)));
  return __builtin_shufflevector(__builtin_convertvector(a, Short4),
                                 __builtin_convertvector(b, Short4), 0, 1, 2, 3, 4, 5, 6, 7);
#endif
}

/// The centre, at the same scale, in lanes 0 to 2.
inline Center8 center_of(SmallBox b) { return (Center8(b) - Center8(swap_halves(b))) >> 1; }
/// One lane of it, of a box in memory.
inline uint16_t center_of(const SmallBox& b, int axis) {
  return static_cast<uint16_t>(static_cast<uint16_t>(b[axis] - b[axis + 4]) >> 1);
}

/// {low.xyz, -, -high.xyz, -} of centres, by the same operations as for boxes.
inline SmallBox centers_of(SmallBox box) {
  const SmallBox c = SmallBox(center_of(box));
  return __builtin_shufflevector(c, -c, 0, 1, 2, 3, 8, 9, 10, 11);
}

/// Products of unsigned lanes without their low 16 bits.
inline Center8 multiply_high(Center8 a, Center8 b) {
#if defined(__SSE2__)
  return Center8(_mm_mulhi_epu16(__m128i(a), __m128i(b)));
#else
  Center8 high;
  for (int k = 0; k < 8; ++k) high[k] = static_cast<uint16_t>(uint32_t(a[k]) * b[k] >> 16);
  return high;
#endif
}

/// An eighth of the area of the box after it has grown by two units, so that flat boxes count.
inline float box_area(SmallBox b) {
  constexpr int16_t kGrown = 2;
  const SmallBox two{kGrown, kGrown, kGrown, 0, 0, 0, 0, 0};
  const SmallBox mask{-1, -1, -1, 0, 0, 0, 0, 0};
  const Center8 twice = Center8(two) - (Center8(b) + Center8(swap_halves(b)));
  const SmallBox e = SmallBox(twice >> 1) & mask;
#if defined(__SSE2__)
  const __m128i turned = _mm_shufflelo_epi16(__m128i(e), _MM_SHUFFLE(3, 0, 2, 1));
  const __m128i pairs = _mm_madd_epi16(__m128i(e), turned);
  return static_cast<float>(
      _mm_cvtsi128_si32(_mm_add_epi32(pairs, _mm_shuffle_epi32(pairs, _MM_SHUFFLE(1, 1, 1, 1)))));
#else
  return static_cast<float>(int32_t(e[0]) * e[1] + int32_t(e[1]) * e[2] + int32_t(e[2]) * e[0]);
#endif
}

inline uint32_t tag_of(SmallBox b) { return uint16_t(b[3]) | uint32_t(uint16_t(b[7])) << 16; }

}  // namespace umbel::cluster
