#include "query/shape_kernels.hpp"

namespace umbel {

const ShapeKernels* shape_kernels(uint32_t width, bool quantised) {
  return with_width(width, [&](auto constant) {
    constexpr uint32_t kWidth = decltype(constant)::value;
    return quantised ? &shape_kernels_of<WideNodes<kWidth, true>>
                     : &shape_kernels_of<WideNodes<kWidth, false>>;
  });
}

}  // namespace umbel
