// Chooses the ray kernels of this machine.
#include "bvh/ray_kernels.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "bvh/ray_frame.hpp"

namespace umbel {
namespace {

/// For trees without nodes, so that no kernel has to ask.
Hit miss(const TriangleBvhData& /*tree*/, const Ray& /*ray*/, const RayOptions& /*options*/) {
  return {};
}
bool nothing_between(const TriangleBvhData& /*tree*/, const Ray& /*ray*/,
                     const RayOptions& /*options*/) {
  return false;
}
size_t no_hits(const TriangleBvhData& /*tree*/, const Ray& /*ray*/, std::span<Hit> /*hits*/,
               const RayOptions& /*options*/) {
  return 0;
}
constexpr RayKernels kEmptyTree{miss, nothing_between, no_hits};

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

const RayKernels* kernels_for(uint32_t width, Simd simd) {
  if (simd == Simd::kPortable) return portable_kernels(width);
  const RayKernels* const avx512 = has_avx512() ? avx512_kernels(width) : nullptr;
  const RayKernels* const avx2 = has_avx2() ? avx2_kernels(width) : nullptr;
  if (simd == Simd::kAvx512) return avx512;
  if (simd == Simd::kAvx2) return avx2;
  if (avx512) return avx512;
  return avx2 ? avx2 : portable_kernels(width);
}

}  // namespace

void prepare_rays(TriangleBvhData& data, Simd simd) {
  const RayKernels* const kernels = kernels_for(data.width, simd);
  if (!kernels)
    throw Error(ErrorCode::kUnsupported, std::string("simd asks for ") +
                                             (simd == Simd::kAvx512 ? "AVX-512" : "AVX2") +
                                             ", which this machine or this build does not have");
  data.kernels = data.nodes.empty() ? &kEmptyTree : kernels;
  data.simd = simd;
  data.reach = 0;
  data.scale = data.unscale = 1;
  if (data.nodes.empty()) return;
  for (const float c : {data.bounds.min.x, data.bounds.min.y, data.bounds.min.z, data.bounds.max.x,
                        data.bounds.max.y, data.bounds.max.z})
    data.reach = std::max(data.reach, std::fabs(c));
  if (data.reach > 0x1p20f || (data.reach < 0x1p-20f && data.reach > 0))
    data.scale = power_of_two(std::clamp(-exponent_of(data.reach), -126, 126));
  data.unscale = 1 / data.scale;
}

void prepare_rays(TriangleBvhData& data) { prepare_rays(data, data.simd); }

}  // namespace umbel
