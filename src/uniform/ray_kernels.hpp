// The ray queries of the uniform structures.
#pragma once

#include "query/ray_kernels.hpp"

namespace umbel {

const RayKernels* portable_grid_kernels();
const RayKernels* portable_octree_kernels();
const RayKernels* portable_interval_kernels();
/// Null where they are not compiled for this processor family.
const RayKernels* avx2_grid_kernels();
const RayKernels* avx2_octree_kernels();
const RayKernels* avx2_interval_kernels();

}  // namespace umbel
