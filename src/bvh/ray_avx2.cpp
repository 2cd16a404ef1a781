#include "bvh/ray_kernels.hpp"

namespace umbel {
const RayKernels* avx2_kernels(uint32_t /*width*/) { return nullptr; }
}  // namespace umbel
