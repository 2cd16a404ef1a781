// Ray kernels for AVX2 with FMA.
#include "bvh/wide/kernels.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
#include "query/begin_avx2.hpp"

// Afterwards, because their templates are to be compiled for these instructions.
#include "bvh/wide/ray_simd.hpp"
#include "query/isa_avx2.hpp"

namespace umbel {
namespace {

// For each mask of eight lanes: the lanes in it, then all others.
struct LaneOrders {
  alignas(64) uint8_t of[256][8];

  constexpr LaneOrders() : of{} {
    for (uint32_t mask = 0; mask < 256; ++mask) {
      uint32_t at = 0;
      for (uint32_t wanted : {1u, 0u})
        for (uint32_t lane = 0; lane < 8; ++lane)
          if ((mask >> lane & 1) == wanted) of[mask][at++] = static_cast<uint8_t>(lane);
    }
  }
};
constexpr LaneOrders kLaneOrders;

struct WideAvx2 : Avx2 {
  /// Otherwise the compiler fills a vector with each number, stores the vectors on the stack and
  /// reads them from there.
  UMBEL_SIMD static const RayFrame* in_memory(const RayFrame* frame) {
    __asm__ volatile("" : "+r"(frame));
    return frame;
  }
  UMBEL_SIMD static __m256i compress(__m256i keys, uint32_t lanes) {
    const auto* const order = reinterpret_cast<const __m128i*>(kLaneOrders.of[lanes]);
    return _mm256_permutevar8x32_epi32(keys, _mm256_cvtepu8_epi32(_mm_loadl_epi64(order)));
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
