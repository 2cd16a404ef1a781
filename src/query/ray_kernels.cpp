// Chooses the ray kernels of this machine.
#include "query/ray_kernels.hpp"

#include <string>

#include "query/leaf_store.hpp"
#include "query/shape_kernels.hpp"

namespace umbel {
namespace {

#if defined(__GNUC__) && defined(__x86_64__)
bool has_avx2() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
         __builtin_cpu_supports("bmi2");
}
bool has_avx512() {
  return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
}
#else
bool has_avx2() { return false; }
bool has_avx512() { return false; }
#endif

const RayKernels* kernels_for(const TriangleBvhData& data, Simd simd) {
  const bool quantised = data.quantised != 0;
  if (simd == Simd::kAvx512) return avx512_kernels(data.width, quantised);
  return simd == Simd::kAvx2 ? avx2_kernels(data.width, quantised)
                             : portable_kernels(data.width, quantised);
}

}  // namespace

Simd choose_simd(Simd wanted) {
  const bool there = wanted == Simd::kAvx512 ? has_avx512() : wanted != Simd::kAvx2 || has_avx2();
  if (!there)
    throw Error(ErrorCode::kUnsupported, std::string("simd asks for ") +
                                             (wanted == Simd::kAvx512 ? "AVX-512" : "AVX2") +
                                             ", which this machine or this build does not have");
  if (wanted != Simd::kAuto) return wanted;
  if (has_avx512()) return Simd::kAvx512;
  return has_avx2() ? Simd::kAvx2 : Simd::kPortable;
}

void prepare_rays(TriangleBvhData& data, Simd simd) {
  const RayKernels* const kernels = kernels_for(data, choose_simd(simd));
  data.rays = data.nodes.empty() ? &kNoRays : kernels;
  data.shapes = shape_kernels(data.width, data.quantised != 0);
  data.simd = simd;
  prepare_scale(data);
}

void prepare_rays(TriangleBvhData& data) { prepare_rays(data, data.simd); }

}  // namespace umbel
