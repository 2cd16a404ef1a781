#include "bvh/shape_kernels.hpp"

namespace umbel {

const ShapeKernels* shape_kernels(uint32_t width) {
  return with_width(
      width, [](auto constant) { return &shape_kernels_of<WideNodes<decltype(constant)::value>>; });
}

}  // namespace umbel
