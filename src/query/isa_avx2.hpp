// What the vector kernels take from AVX2, for translation units that turn it on before they include
// this.
#pragma once

#include "query/simd_triangles.hpp"

namespace umbel {
namespace {

struct Avx2 {
  using Lanes = __m256;
  UMBEL_SIMD static Lanes le(__m256 a, __m256 b) { return _mm256_cmp_ps(a, b, _CMP_LE_OQ); }
  UMBEL_SIMD static Lanes eq(__m256 a, __m256 b) { return _mm256_cmp_ps(a, b, _CMP_EQ_OQ); }
  UMBEL_SIMD static Lanes both(Lanes a, Lanes b) { return _mm256_and_ps(a, b); }
  UMBEL_SIMD static Lanes either(Lanes a, Lanes b) { return _mm256_or_ps(a, b); }
  UMBEL_SIMD static uint32_t bits(Lanes lanes) {
    return static_cast<uint32_t>(_mm256_movemask_ps(lanes));
  }
  UMBEL_SIMD static __m256 load(const uint32_t* words, uint32_t /*n*/) {
    return _mm256_loadu_ps(reinterpret_cast<const float*>(words));
  }
  /// Lanes beyond n repeat vertex 0, because what follows may be no vertex's number.
  UMBEL_SIMD static __m256i load_ids(const uint32_t* words, uint32_t n) {
    const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256i wanted = _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(n)), lanes);
    return _mm256_and_si256(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(words)), wanted);
  }
  UMBEL_SIMD static __m256 gather(const float* base, __m256i at, uint32_t /*n*/) {
    return _mm256_i32gather_ps(base, at, 4);
  }
};

}  // namespace

}  // namespace umbel
