// Gives a wide tree the kernels of its width, its nodes and this machine.
#include "bvh/wide/kernels.hpp"

#include "bvh/wide/triangle_bvh_data.hpp"
#include "bvh/wide/wide_nodes.hpp"

namespace umbel {
namespace {

const RayKernels* kernels_for(const BvhData& data, Simd simd) {
  const bool quantised = data.quantised != 0;
  if (simd == Simd::kAvx512) return avx512_kernels(data.width, quantised);
  return simd == Simd::kAvx2 ? avx2_kernels(data.width, quantised)
                             : portable_kernels(data.width, quantised);
}

}  // namespace

const ShapeKernels* shape_kernels(uint32_t width, bool quantised) {
  return with_width(width, [&](auto constant) {
    constexpr uint32_t kWidth = decltype(constant)::value;
    return quantised ? &shape_kernels_of<WideNodes<kWidth, true>>
                     : &shape_kernels_of<WideNodes<kWidth, false>>;
  });
}

void prepare_rays(BvhData& data, Simd simd) {
  const RayKernels* const kernels = kernels_for(data, choose_simd(simd));
  data.rays = data.nodes.empty() ? &kNoRays : kernels;
  data.shapes = shape_kernels(data.width, data.quantised != 0);
  data.simd = simd;
  prepare_scale(data);
}

void prepare_rays(BvhData& data) { prepare_rays(data, data.simd); }

}  // namespace umbel
