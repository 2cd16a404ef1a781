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

  /// Sorts the children's keys by a network of four or eight. The nearest comes last, where it is
  /// not on the stack any more.
  UMBEL_SIMD static void push(const NodeChildren& children, uint32_t entered, uint32_t /*nearest*/,
                              StackEntry*& top) {
    const __m256i last = _mm256_set1_epi32(std::numeric_limits<int32_t>::max());
    const __m256i keys =
        _mm256_mask_compress_epi32(last, static_cast<__mmask8>(entered), children.keys());
    const auto others = static_cast<uint32_t>(std::popcount(entered)) - 1;
    const __m256i descending = _mm256_sub_epi32(_mm256_set1_epi32(static_cast<int>(others)),
                                                _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    StackEntry* const first = top;
    top += others;
    if (others < 4) {
      const __m128i sorted = sort4(_mm256_castsi256_si128(keys));
      store4(children,
             _mm_castps_si128(
                 _mm_permutevar_ps(_mm_castsi128_ps(sorted), _mm256_castsi256_si128(descending))),
             first);
      return;
    }
    const __m256i order = _mm256_permutexvar_epi32(descending, sort8(keys));
    store4(children, _mm256_castsi256_si128(order), first);
    store4(children, _mm256_extracti128_si256(order, 1), first + 4);
  }

 private:
  /// By keys, of which only the child's number counts.
  UMBEL_SIMD static void store4(const NodeChildren& children, __m128i keys, StackEntry* at) {
    const __m256i links = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(children.links));
    const __m256i twice = _mm256_permutevar8x32_epi32(_mm256_castsi128_si256(keys),
                                                      _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3));
    const __m256i link = _mm256_permutevar8x32_epi32(links, twice);
    const __m256i near = _mm256_castps_si256(_mm256_permutevar8x32_ps(children.near, twice));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(at), _mm256_blend_epi32(link, near, 0b10101010));
  }
  /// Keeps the larger of the two where the bit is set, else the smaller.
  template <uint32_t larger>
  UMBEL_SIMD static __m128i exchange(__m128i a, __m128i b) {
    return _mm_blend_epi32(_mm_min_epi32(a, b), _mm_max_epi32(a, b), larger);
  }
  template <uint32_t larger>
  UMBEL_SIMD static __m256i exchange(__m256i a, __m256i b) {
    return _mm256_blend_epi32(_mm256_min_epi32(a, b), _mm256_max_epi32(a, b), larger);
  }
  UMBEL_SIMD static __m128i sort4(__m128i a) {
    a = exchange<0b1010>(a, _mm_shuffle_epi32(a, _MM_PERM_CDAB));
    a = exchange<0b1100>(a, _mm_shuffle_epi32(a, _MM_PERM_BADC));
    return exchange<0b0100>(a, _mm_shuffle_epi32(a, _MM_PERM_DBCA));
  }
  UMBEL_SIMD static __m256i sort8(__m256i a) {
    const __m256i reversed = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
    a = exchange<0b10101010>(a, _mm256_shuffle_epi32(a, _MM_PERM_CDAB));
    a = exchange<0b11001100>(a, _mm256_shuffle_epi32(a, _MM_PERM_ABCD));
    a = exchange<0b10101010>(a, _mm256_shuffle_epi32(a, _MM_PERM_CDAB));
    a = exchange<0b11110000>(a, _mm256_permutexvar_epi32(reversed, a));
    a = exchange<0b11001100>(a, _mm256_shuffle_epi32(a, _MM_PERM_BADC));
    return exchange<0b10101010>(a, _mm256_shuffle_epi32(a, _MM_PERM_CDAB));
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
