// Ray kernels for AVX2 with FMA.
#include "uniform/ray_kernels.hpp"

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
// After the pragma, because their templates are to be compiled for these instructions.
#include "query/isa_avx2.hpp"
#include "uniform/grid_traverse.hpp"
#include "uniform/interval_traverse.hpp"

namespace umbel {

const RayKernels* avx2_grid_kernels() { return grid_kernels<TriangleTester<Avx2>>(); }
const RayKernels* avx2_interval_kernels() { return interval_kernels<TriangleTester<Avx2>>(); }

}  // namespace umbel

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

#else
namespace umbel {
const RayKernels* avx2_grid_kernels() { return nullptr; }
const RayKernels* avx2_interval_kernels() { return nullptr; }
}  // namespace umbel
#endif
