#include "bvh/shape_kernels.hpp"

namespace umbel {

const ShapeKernels* shape_kernels(uint32_t width) {
  if (width == 2) return &shape_kernels_of<WideNodes<2>>;
  if (width == 4) return &shape_kernels_of<WideNodes<4>>;
  return &shape_kernels_of<WideNodes<8>>;
}

}  // namespace umbel
