// Four floats on which arithmetic works lane by lane (an extension of GCC and Clang): SSE2 where it
// is the baseline, plain code elsewhere, with the same results.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <utility>

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

// The same as a class, for code that still uses it.
namespace umbel::lod {

#if defined(__SSE2__)

class Float4 {
 public:
  Float4(__m128 lanes) : lanes_(lanes) {}  // NOLINT(google-explicit-constructor)
  static Float4 all(float x) { return _mm_set1_ps(x); }
  static Float4 load(const float* p) { return _mm_loadu_ps(p); }
  void store(float* p) const { _mm_storeu_ps(p, lanes_); }

  friend Float4 operator+(Float4 a, Float4 b) { return _mm_add_ps(a.lanes_, b.lanes_); }
  friend Float4 operator-(Float4 a, Float4 b) { return _mm_sub_ps(a.lanes_, b.lanes_); }
  friend Float4 operator*(Float4 a, Float4 b) { return _mm_mul_ps(a.lanes_, b.lanes_); }
  friend Float4 min(Float4 a, Float4 b) { return _mm_min_ps(a.lanes_, b.lanes_); }
  friend Float4 max(Float4 a, Float4 b) { return _mm_max_ps(a.lanes_, b.lanes_); }
  /// Bit i is set where lane i of a is at most that of b.
  friend uint32_t at_most(Float4 a, Float4 b) {
    return static_cast<uint32_t>(_mm_movemask_ps(_mm_cmple_ps(a.lanes_, b.lanes_)));
  }
  /// Lane i of the j-th becomes lane j of the i-th.
  friend void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
    _MM_TRANSPOSE4_PS(a.lanes_, b.lanes_, c.lanes_, d.lanes_);
  }

 private:
  __m128 lanes_;
};

#else

class Float4 {
 public:
  static Float4 all(float x) { return Float4{{x, x, x, x}}; }
  static Float4 load(const float* p) { return Float4{{p[0], p[1], p[2], p[3]}}; }
  void store(float* p) const {
    for (int i = 0; i < 4; ++i) p[i] = lanes_[i];
  }

  friend Float4 operator+(const Float4& a, const Float4& b) {
    return combine(a, b, [](float x, float y) { return x + y; });
  }
  friend Float4 operator-(const Float4& a, const Float4& b) {
    return combine(a, b, [](float x, float y) { return x - y; });
  }
  friend Float4 operator*(const Float4& a, const Float4& b) {
    return combine(a, b, [](float x, float y) { return x * y; });
  }
  friend Float4 min(const Float4& a, const Float4& b) {
    return combine(a, b, [](float x, float y) { return x < y ? x : y; });
  }
  friend Float4 max(const Float4& a, const Float4& b) {
    return combine(a, b, [](float x, float y) { return x > y ? x : y; });
  }
  friend uint32_t at_most(const Float4& a, const Float4& b) {
    uint32_t bits = 0;
    for (uint32_t i = 0; i < 4; ++i) bits |= uint32_t{a.lanes_[i] <= b.lanes_[i]} << i;
    return bits;
  }
  friend void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
    const std::array<Float4*, 4> rows = {&a, &b, &c, &d};
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < i; ++j) std::swap(rows[i]->lanes_[j], rows[j]->lanes_[i]);
  }

 private:
  explicit Float4(const std::array<float, 4>& lanes) : lanes_(lanes) {}
  template <typename Operation>
  static Float4 combine(const Float4& a, const Float4& b, const Operation& operation) {
    Float4 result = a;
    for (int i = 0; i < 4; ++i) result.lanes_[i] = operation(a.lanes_[i], b.lanes_[i]);
    return result;
  }

  std::array<float, 4> lanes_;
};

#endif

}  // namespace umbel::lod
