// Four floats on which arithmetic works lane by lane (an extension of GCC and Clang): SSE2 where it
// is the baseline, plain code elsewhere, with the same results.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace umbel {

typedef float Float4 __attribute__((vector_size(16)));
typedef int32_t Int4 __attribute__((vector_size(16)));

inline Float4 load4(const float* p) {
  Float4 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline void store4(float* p, Float4 v) { std::memcpy(p, &v, sizeof v); }
inline Float4 splat(float x) { return Float4{x, x, x, x}; }

/// Of equal or unordered lanes, that of b.
inline Float4 min4(Float4 a, Float4 b) {
#if defined(__SSE2__)
  return Float4(_mm_min_ps(__m128(a), __m128(b)));
#else
  return a < b ? a : b;
#endif
}
inline Float4 max4(Float4 a, Float4 b) {
#if defined(__SSE2__)
  return Float4(_mm_max_ps(__m128(a), __m128(b)));
#else
  return a > b ? a : b;
#endif
}

inline Float4 sqrt4(Float4 a) {
#if defined(__SSE2__)
  return Float4(_mm_sqrt_ps(__m128(a)));
#else
  for (int i = 0; i < 4; ++i) a[i] = __builtin_sqrtf(a[i]);
  return a;
#endif
}

/// Bit i is set where lane i of a is at most that of b.
inline uint32_t at_most(Float4 a, Float4 b) {
#if defined(__SSE2__)
  return static_cast<uint32_t>(_mm_movemask_ps(_mm_cmple_ps(__m128(a), __m128(b))));
#else
  uint32_t bits = 0;
  for (uint32_t i = 0; i < 4; ++i) bits |= uint32_t{a[i] <= b[i]} << i;
  return bits;
#endif
}

/// Lane i of the j-th becomes lane j of the i-th.
inline void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
  const Float4 ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Float4 cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

}  // namespace umbel
