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
  UMBEL_SIMD static void push(const NodeChildren& children, uint32_t entered, uint32_t nearest,
                              StackEntry*& top) {
    alignas(32) float distances[8];
    _mm256_store_ps(distances, children.near);
    push_sorted(children.links, entered ^ (1u << nearest), distances, top);
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
