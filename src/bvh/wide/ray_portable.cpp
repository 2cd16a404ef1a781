// Ray kernels in plain C++, for machines without AVX2 and as the reference for the others.
#include "bvh/wide/kernels.hpp"
#include "bvh/wide/portable_intersector.hpp"

namespace umbel {
const RayKernels* portable_kernels(uint32_t width, bool quantised) {
  if (width == 2)
    return quantised ? &kernels_of<PortableIntersector<2, true>>
                     : &kernels_of<PortableIntersector<2>>;
  if (width == 4)
    return quantised ? &kernels_of<PortableIntersector<4, true>>
                     : &kernels_of<PortableIntersector<4>>;
  return quantised ? &kernels_of<PortableIntersector<8, true>>
                   : &kernels_of<PortableIntersector<8>>;
}

}  // namespace umbel
