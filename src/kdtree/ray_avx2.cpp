// Ray kernels for AVX2 with FMA.
#include "kdtree/ray_kernels.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
#include "query/begin_avx2.hpp"

// Afterwards, because their templates are to be compiled for these instructions.
#include "kdtree/ray_traverse.hpp"
#include "query/isa_avx2.hpp"

namespace umbel {

const RayKernels* avx2_kd_kernels(kdtree::Traversal traversal) {
  return kd_kernels<TriangleTester<Avx2>>(traversal);
}

}  // namespace umbel

#include "query/end_target.hpp"

#else
namespace umbel {
const RayKernels* avx2_kd_kernels(kdtree::Traversal /*traversal*/) { return nullptr; }
}  // namespace umbel
#endif
