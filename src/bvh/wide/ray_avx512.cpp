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
// There are fused multiplications and additions. GCC decides on __FMA__ before it sees the pragma.
#define UMBEL_FMA
// After the pragma, because its templates are to be compiled for these instructions.
#include "bvh/wide/ray_simd.hpp"

namespace umbel {
namespace {

struct Avx512 {
  using Lanes = __mmask8;
  UMBEL_SIMD static Lanes le(__m256 a, __m256 b) { return _mm256_cmp_ps_mask(a, b, _CMP_LE_OQ); }
  UMBEL_SIMD static Lanes eq(__m256 a, __m256 b) { return _mm256_cmp_ps_mask(a, b, _CMP_EQ_OQ); }
  UMBEL_SIMD static Lanes both(Lanes a, Lanes b) { return _kand_mask8(a, b); }
  UMBEL_SIMD static Lanes either(Lanes a, Lanes b) { return _kor_mask8(a, b); }
  UMBEL_SIMD static uint32_t bits(Lanes lanes) { return lanes; }
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
  UMBEL_SIMD static const RayFrame* in_memory(const RayFrame* frame) { return frame; }
  UMBEL_SIMD static __m256i compress(__m256i keys, uint32_t lanes) {
    return _mm256_mask_compress_epi32(_mm256_set1_epi32(-1), static_cast<__mmask8>(lanes), keys);
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
