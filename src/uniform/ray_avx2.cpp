// Ray kernels for AVX2 with FMA.
#include "uniform/ray_kernels.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
#include "query/begin_avx2.hpp"

// Afterwards, because their templates are to be compiled for these instructions.
#include "query/isa_avx2.hpp"
#include "uniform/grid_traverse.hpp"
#include "uniform/interval_traverse.hpp"
#include "uniform/octree_traverse.hpp"

namespace umbel {

const RayKernels* avx2_grid_kernels() { return grid_kernels<TriangleTester<Avx2>>(); }
const RayKernels* avx2_octree_kernels() { return octree_kernels<TriangleTester<Avx2>>(); }
const RayKernels* avx2_interval_kernels() { return interval_kernels<TriangleTester<Avx2>>(); }

}  // namespace umbel

#include "query/end_target.hpp"

#else
namespace umbel {
const RayKernels* avx2_grid_kernels() { return nullptr; }
const RayKernels* avx2_octree_kernels() { return nullptr; }
const RayKernels* avx2_interval_kernels() { return nullptr; }
}  // namespace umbel
#endif
