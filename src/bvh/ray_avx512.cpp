#include "bvh/ray_kernels.hpp"

namespace umbel {
const RayKernels* avx512_kernels(uint32_t /*width*/) { return nullptr; }
}  // namespace umbel
