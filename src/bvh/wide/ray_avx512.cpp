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

  UMBEL_SIMD static uint32_t mask_le_bits(__m256i a, __m256i b) {
    return _mm256_cmple_epi32_mask(a, b);
  }

  /// Sorts distances as integers, whose last three bits give way to the child's number, by a
  /// network of two, four or eight. So children that are entered at almost the same distance come
  /// in the order of their numbers. Which is the nearest is known before the others are sorted, and
  /// is what the next node waits for. Negative distances come in the wrong order. All that costs
  /// time and nothing else: the distances on the stack are exact.
  UMBEL_SIMD static uint32_t push(const uint32_t* links, uint32_t entered, __m256 near,
                                  StackEntry*& top) {
    constexpr int kNearOrNumber = 0xBA;  // (near & ~seven) | number
    const __m256i number = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256i seven = _mm256_set1_epi32(7);
    const __m256i last = _mm256_set1_epi32(std::numeric_limits<int32_t>::max());
    const __m256i keys =
        _mm256_ternarylogic_epi32(_mm256_castps_si256(near), seven, number, kNearOrNumber);
    const __m256i packed = _mm256_mask_compress_epi32(last, static_cast<__mmask8>(entered), keys);
    const __m128i few = _mm256_castsi256_si128(packed);
    const auto count = static_cast<uint32_t>(std::popcount(entered));
    const Children children{_mm256_loadu_si256(reinterpret_cast<const __m256i*>(links)), near};
    if (count == 2) {
      const __m128i swapped = _mm_shuffle_epi32(few, _MM_PERM_CDAB);
      const __m128i further = _mm_max_epi32(few, swapped);
      _mm_storel_epi64(reinterpret_cast<__m128i*>(top++), children.pair(further));
      return links[child_of(_mm_min_epi32(few, swapped))];
    }
    StackEntry* const first = top;
    top += count - 1;
    // The furthest comes first, the second nearest last.
    const __m256i descending =
        _mm256_sub_epi32(_mm256_set1_epi32(static_cast<int>(count - 1)), number);
    if (count <= 4) {
      uint32_t nearest;
      const __m128i sorted = sort4(few, nearest);
      const __m128i order = _mm_castps_si128(
          _mm_permutevar_ps(_mm_castsi128_ps(sorted), _mm256_castsi256_si128(descending)));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(first), children.four(order));
      return links[nearest];
    }
    const uint32_t nearest = child_of(least(few, _mm256_extracti128_si256(packed, 1)));
    const __m256i order = _mm256_permutexvar_epi32(descending, sort8(packed));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(first),
                        children.four(_mm256_castsi256_si128(order)));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(first + 4),
                        children.four(_mm256_extracti128_si256(order, 1)));
    return links[nearest];
  }

 private:
  /// What goes onto the stack, by keys: only their last three bits count.
  struct Children {
    __m256i links;
    __m256 near;

    UMBEL_SIMD __m256i four(__m128i keys) const {
      const __m256i doubled = _mm256_permutevar8x32_epi32(
          _mm256_castsi128_si256(keys), _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3));
      const __m256i link = _mm256_permutevar8x32_epi32(links, doubled);
      const __m256i distance = _mm256_castps_si256(_mm256_permutevar8x32_ps(near, doubled));
      return _mm256_blend_epi32(link, distance, 0b10101010);
    }
    UMBEL_SIMD __m128i pair(__m128i keys) const {
      const __m256i wide = _mm256_castsi128_si256(keys);
      const __m256i link = _mm256_permutevar8x32_epi32(links, wide);
      const __m256i distance = _mm256_castps_si256(_mm256_permutevar8x32_ps(near, wide));
      return _mm_unpacklo_epi32(_mm256_castsi256_si128(link), _mm256_castsi256_si128(distance));
    }
  };

  UMBEL_SIMD static uint32_t child_of(__m128i keys) {
    return static_cast<uint32_t>(_mm_cvtsi128_si32(keys)) & 7;
  }
  UMBEL_SIMD static __m128i least(__m128i a, __m128i b) {
    a = _mm_min_epi32(a, b);
    a = _mm_min_epi32(a, _mm_shuffle_epi32(a, _MM_PERM_BADC));
    return _mm_min_epi32(a, _mm_shuffle_epi32(a, _MM_PERM_CDAB));
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
  UMBEL_SIMD static __m128i sort4(__m128i a, uint32_t& nearest) {
    a = exchange<0b1010>(a, _mm_shuffle_epi32(a, _MM_PERM_CDAB));
    a = exchange<0b1100>(a, _mm_shuffle_epi32(a, _MM_PERM_BADC));
    nearest = child_of(a);
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
