// Ray kernels in plain C++, for machines without AVX2 and as the reference for the others.
#include "query/plain_triangles.hpp"
#include "uniform/grid_traverse.hpp"
#include "uniform/interval_traverse.hpp"
#include "uniform/octree_traverse.hpp"
#include "uniform/ray_kernels.hpp"

namespace umbel {
namespace {

struct PlainUniform {};

}  // namespace

const RayKernels* portable_grid_kernels() { return grid_kernels<PlainTriangles<PlainUniform>>(); }
const RayKernels* portable_octree_kernels() {
  return octree_kernels<PlainTriangles<PlainUniform>>();
}
const RayKernels* portable_interval_kernels() {
  return interval_kernels<PlainTriangles<PlainUniform>>();
}

}  // namespace umbel
