// Ray kernels for AVX-512 (F, VL, DQ, BW): eight lanes as in AVX2, but with mask registers, twice
// as many vector registers and children sorted in one of them.
#include "bvh/wide/kernels.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
#include <immintrin.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <type_traits>

#if !defined(__clang__)
// GCC 12 takes its own headers' deliberately undefined vectors for mistakes.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif
#if defined(__clang__)
#pragma clang attribute push(                                                                     \
    __attribute__((target("avx2,fma,bmi,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw"))), \
    apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma,bmi,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")
#endif
// After the pragma, because its templates are to be compiled for these instructions.
#include "bvh/wide/ray_simd.hpp"

namespace umbel {
namespace {

struct Avx512 {
  UMBEL_SIMD static uint32_t mask_le(__m256 a, __m256 b) {
    return _mm256_cmp_ps_mask(a, b, _CMP_LE_OQ);
  }
  UMBEL_SIMD static uint32_t mask_eq(__m256 a, __m256 b) {
    return _mm256_cmp_ps_mask(a, b, _CMP_EQ_OQ);
  }
  UMBEL_SIMD static uint32_t children(const uint32_t* links) {
    return _mm256_cmpneq_epi32_mask(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(links)),
                                    _mm256_set1_epi32(-1));
  }
  UMBEL_SIMD static __m256 load(const uint32_t* words, uint32_t /*n*/) {
    return _mm256_loadu_ps(reinterpret_cast<const float*>(words));
  }
  UMBEL_SIMD static __m256i load_ids(const uint32_t* words, uint32_t n) {
    return _mm256_maskz_loadu_epi32(static_cast<__mmask8>((1u << n) - 1), words);
  }
  UMBEL_SIMD static __m256 gather(const float* base, __m256i at, uint32_t n) {
    return _mm256_mmask_i32gather_ps(_mm256_setzero_ps(), static_cast<__mmask8>((1u << n) - 1), at,
                                     base, 4);
  }

  /// Sorts (distance, link) as 64-bit integers by a network, of two, four or eight. Which is the
  /// nearest is known before the others are sorted, and is what the next node waits for. Negative
  /// distances come in the wrong order, which costs time and nothing else.
  UMBEL_SIMD static uint32_t push(const uint32_t* at, uint32_t entered, __m256 near,
                                  StackEntry*& top) {
    const auto count = static_cast<uint32_t>(std::popcount(entered));
    const __m256i links = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at));
    const __m512i interleave =
        _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
    const __m512i entries =
        _mm512_permutex2var_epi32(_mm512_castsi256_si512(links), interleave,
                                  _mm512_castsi256_si512(_mm256_castps_si256(near)));
    const __m512i last = _mm512_set1_epi64(std::numeric_limits<int64_t>::max());
    const __m512i packed =
        _mm512_mask_compress_epi64(last, static_cast<__mmask8>(entered), entries);
    if (count == 2) return push2(_mm512_castsi512_si128(packed), top);
    // The furthest of the others comes first, the second nearest last.
    const __m512i descending =
        _mm512_sub_epi64(_mm512_set1_epi64(count - 1), _mm512_setr_epi64(0, 1, 2, 3, 4, 5, 6, 7));
    StackEntry* const first = top;
    top += count - 1;
    if (count <= 4)
      return push4(_mm512_castsi512_si256(packed), _mm512_castsi512_si256(descending), first);
    const __m512i sorted = sort8(packed);
    _mm512_storeu_si512(first, _mm512_permutexvar_epi64(descending, sorted));
    return link_of(_mm512_castsi512_si128(sorted));
  }

  UMBEL_SIMD static uint32_t link_of(__m128i entry) {
    return static_cast<uint32_t>(_mm_cvtsi128_si32(entry));
  }
  UMBEL_SIMD static uint32_t push2(__m128i a, StackEntry*& top) {
    const __m128i b = _mm_shuffle_epi32(a, _MM_PERM_BADC);
    _mm_storel_epi64(reinterpret_cast<__m128i*>(top++), _mm_max_epi64(a, b));
    return link_of(_mm_min_epi64(a, b));
  }
  UMBEL_SIMD static uint32_t push4(__m256i a, __m256i descending, StackEntry* first) {
    a = exchange4<0b1010>(a, _mm256_shuffle_epi32(a, _MM_PERM_BADC));
    a = exchange4<0b1100>(a, _mm256_permute4x64_epi64(a, 0b01'00'11'10));
    const uint32_t nearest = link_of(_mm256_castsi256_si128(a));
    a = exchange4<0b0100>(a, _mm256_permute4x64_epi64(a, 0b11'01'10'00));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(first), _mm256_permutexvar_epi64(descending, a));
    return nearest;
  }
  /// Keeps the larger of the two where the bit is set, else the smaller.
  template <uint32_t larger>
  UMBEL_SIMD static __m256i exchange4(__m256i a, __m256i b) {
    return _mm256_mask_max_epi64(_mm256_min_epi64(a, b), larger, a, b);
  }

  UMBEL_SIMD static __m512i sort8(__m512i a) {
    a = exchange8(a, 0b10101010, _mm512_setr_epi64(1, 0, 3, 2, 5, 4, 7, 6));
    a = exchange8(a, 0b11001100, _mm512_setr_epi64(3, 2, 1, 0, 7, 6, 5, 4));
    a = exchange8(a, 0b10101010, _mm512_setr_epi64(1, 0, 3, 2, 5, 4, 7, 6));
    a = exchange8(a, 0b11110000, _mm512_setr_epi64(7, 6, 5, 4, 3, 2, 1, 0));
    a = exchange8(a, 0b11001100, _mm512_setr_epi64(2, 3, 0, 1, 6, 7, 4, 5));
    return exchange8(a, 0b10101010, _mm512_setr_epi64(1, 0, 3, 2, 5, 4, 7, 6));
  }
  UMBEL_SIMD static __m512i exchange8(__m512i a, __mmask8 larger, __m512i partners) {
    const __m512i b = _mm512_permutexvar_epi64(partners, a);
    return _mm512_mask_max_epi64(_mm512_min_epi64(a, b), larger, a, b);
  }
};

}  // namespace

const RayKernels* avx512_kernels(uint32_t width, bool quantised) {
  return simd_kernels<Avx512>(width, quantised);
}

}  // namespace umbel

#include "query/end_target.hpp"

#else
namespace umbel {
const RayKernels* avx512_kernels(uint32_t /*width*/, bool /*quantised*/) { return nullptr; }
}  // namespace umbel
#endif
