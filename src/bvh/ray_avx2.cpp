// Ray kernels for AVX2 with FMA.
#include "bvh/ray_kernels.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
#include <immintrin.h>

#include <algorithm>
#include <limits>
#include <memory>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma,bmi,bmi2,lzcnt,popcnt"))), \
                             apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma,bmi,bmi2,lzcnt,popcnt")
#endif
// After the pragma, because its templates are to be compiled for these instructions.
#include "bvh/ray_simd.hpp"

namespace umbel {
namespace {

struct Avx2 {
  UMBEL_SIMD static uint32_t mask_le(__m256 a, __m256 b) {
    return static_cast<uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ)));
  }
  UMBEL_SIMD static uint32_t mask_eq(__m256 a, __m256 b) {
    return static_cast<uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_EQ_OQ)));
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
  UMBEL_SIMD static uint32_t push(const uint32_t* node, uint32_t slots, __m256 near,
                                  StackEntry*& top) {
    alignas(32) float distances[8];
    _mm256_store_ps(distances, near);
    return push_sorted<8>(node, slots, distances, top);
  }
};

}  // namespace

const RayKernels* avx2_kernels(uint32_t width) {
  if (width == 2) return &kernels_of<NarrowLanes<Avx2, 2>>;
  if (width == 4) return &kernels_of<NarrowLanes<Avx2, 4>>;
  return &kernels_of<WideLanes<Avx2>>;
}

}  // namespace umbel

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

#else
namespace umbel {
const RayKernels* avx2_kernels(uint32_t /*width*/) { return nullptr; }
}  // namespace umbel
#endif
