// Chooses the instruction set of this machine's ray kernels.
#include "query/ray_kernels.hpp"

#include <string>

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

}  // namespace

Simd choose_simd(Simd wanted) {
  if (wanted > Simd::kAvx512)
    throw Error(
        ErrorCode::kInvalidArgument,
        "simd is " + std::to_string(static_cast<uint32_t>(wanted)) + ", but its values are 0 to 3");
  const bool there = wanted == Simd::kAvx512 ? has_avx512() : wanted != Simd::kAvx2 || has_avx2();
  if (!there)
    throw Error(ErrorCode::kUnsupported, std::string("simd asks for ") +
                                             (wanted == Simd::kAvx512 ? "AVX-512" : "AVX2") +
                                             ", which this machine or this build does not have");
  if (wanted != Simd::kAuto) return wanted;
  if (has_avx512()) return Simd::kAvx512;
  return has_avx2() ? Simd::kAvx2 : Simd::kPortable;
}

}  // namespace umbel
