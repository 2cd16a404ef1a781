// Ray kernels for AVX2 with FMA.
#include "query/ray_kernels.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
#include <immintrin.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <type_traits>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma,bmi,bmi2,lzcnt,popcnt"))), \
                             apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma,bmi,bmi2,lzcnt,popcnt")
#endif
// After the pragma, because its templates are to be compiled for these instructions.
#include "query/isa_avx2.hpp"

namespace umbel {
const RayKernels* avx2_kernels(uint32_t width, bool quantised) {
  return simd_kernels<Avx2>(width, quantised);
}

}  // namespace umbel

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

#else
namespace umbel {
const RayKernels* avx2_kernels(uint32_t /*width*/, bool /*quantised*/) { return nullptr; }
}  // namespace umbel
#endif
