// Ray kernels in plain C++, for machines without AVX2 and as the reference for the others.
#include "kdtree/ray_kernels.hpp"
#include "kdtree/ray_traverse.hpp"
#include "query/plain_triangles.hpp"

namespace umbel {
namespace {

struct PlainKd {};

}  // namespace

const RayKernels* portable_kd_kernels(kdtree::Traversal traversal) {
  return kd_kernels<PlainTriangles<PlainKd>>(traversal);
}

}  // namespace umbel
