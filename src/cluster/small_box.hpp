// Boxes rounded to 15 bits a coordinate, sixteen bytes each, so that a union is one minimum:
// {low.xyz, low half of the tag, -high.xyz, high half of the tag}. Unions leave garbage in the tag.
#pragma once

#include <array>
#include <cstdint>

#include "cluster/box_record.hpp"

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

/// The first four lanes, from -32768 to 32767, as floats.
inline Float4 floats_of(SmallBox b) {
#if defined(__SSE2__)
  return Float4(_mm_cvtepi32_ps(_mm_srai_epi32(_mm_unpacklo_epi16(__m128i(b), __m128i(b)), 16)));
#else
  return Float4{float(b[0]), float(b[1]), float(b[2]), float(b[3])};
#endif
}

/// The centre, at the same scale, in lanes 0 to 2.
inline Center8 center_of(SmallBox b) { return Center8(b - swap_halves(b)) >> 1; }

/// Half the area of the box after it has grown by one unit, so that flat boxes count.
inline float half_area(SmallBox b) {
  const Float4 e = splat(1.0f) - floats_of(b + swap_halves(b));
  const Float4 p = e * __builtin_shufflevector(e, e, 1, 2, 0, 3);
  return p[0] + p[1] + p[2];
}

inline uint32_t tag_of(SmallBox b) { return uint16_t(b[3]) | uint32_t(uint16_t(b[7])) << 16; }

}  // namespace umbel::cluster
