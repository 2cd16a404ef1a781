// Ray kernels for AVX2 with FMA.
#include "bvh/wide/kernels.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
#include "query/begin_avx2.hpp"

// Afterwards, because their templates are to be compiled for these instructions.
#include "bvh/wide/ray_simd.hpp"
#include "query/isa_avx2.hpp"

namespace umbel {
namespace {

struct WideAvx2 : Avx2 {
  UMBEL_SIMD static uint32_t mask_le_bits(__m256i a, __m256i b) {
    const __m256 greater = _mm256_castsi256_ps(_mm256_cmpgt_epi32(a, b));
    return static_cast<uint32_t>(_mm256_movemask_ps(greater)) ^ 255u;
  }
  UMBEL_SIMD static uint32_t children(const uint32_t* links) {
    const __m256i all = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(links));
    const __m256i none = _mm256_cmpeq_epi32(all, _mm256_set1_epi32(-1));
    return ~static_cast<uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(none)));
  }
  UMBEL_SIMD static uint32_t push(const uint32_t* links, uint32_t entered, __m256 near,
                                  StackEntry*& top) {
    alignas(32) float distances[8];
    _mm256_store_ps(distances, near);
    return push_sorted<8>(links, entered, distances, top);
  }
};

}  // namespace

const RayKernels* avx2_kernels(uint32_t width, bool quantised) {
  return simd_kernels<WideAvx2>(width, quantised);
}

}  // namespace umbel

#include "query/end_target.hpp"

#else
namespace umbel {
const RayKernels* avx2_kernels(uint32_t /*width*/, bool /*quantised*/) { return nullptr; }
}  // namespace umbel
#endif
