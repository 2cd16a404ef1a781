// The kernels of wide trees: one table of functions for each width, kind of node and instruction
// set.
#pragma once

#include <cstdint>

#include "query/ray_kernels.hpp"
#include "query/shape_kernels.hpp"

namespace umbel {

const RayKernels* portable_kernels(uint32_t width, bool quantised);
/// Null where they are not compiled for this processor family.
const RayKernels* avx2_kernels(uint32_t width, bool quantised);
const RayKernels* avx512_kernels(uint32_t width, bool quantised);

const ShapeKernels* shape_kernels(uint32_t width, bool quantised);

}  // namespace umbel
