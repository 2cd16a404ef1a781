// The ray queries, one table of functions for each traversal and instruction set.
#pragma once

#include "kdtree/tree_data.hpp"
#include "query/ray_kernels.hpp"

namespace umbel {

const RayKernels* portable_kd_kernels(kdtree::Traversal traversal);
/// Null where they are not compiled for this processor family.
const RayKernels* avx2_kd_kernels(kdtree::Traversal traversal);

}  // namespace umbel
