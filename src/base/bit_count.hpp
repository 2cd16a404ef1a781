// Counts of the bits of a number, on processors and devices. On a device those of <bit> compile,
// but with --expt-relaxed-constexpr they give wrong numbers: CUDA's compiler drops what GCC's
// built-in functions for `unsigned long` and for trailing zeros do. scripts/check_device_code.py
// keeps them out of device code.
#pragma once

#include <bit>
#include <concepts>
#include <cstdint>

#include "base/host_device.hpp"

namespace umbel {

/// Bits that are set.
template <std::unsigned_integral T>
UMBEL_HOST_DEVICE inline uint32_t count_bits(T bits) {
#if defined(__CUDA_ARCH__)
  if constexpr (sizeof(T) == 8) return uint32_t(__popcll(static_cast<unsigned long long>(bits)));
  return uint32_t(__popc(uint32_t(bits)));
#else
  return uint32_t(std::popcount(bits));
#endif
}

/// Zeros above the highest bit that is set; all bits of T if none is.
template <std::unsigned_integral T>
UMBEL_HOST_DEVICE inline uint32_t leading_zeros(T bits) {
#if defined(__CUDA_ARCH__)
  if constexpr (sizeof(T) == 8) return uint32_t(__clzll(static_cast<long long>(bits)));
  return uint32_t(__clz(int(uint32_t(bits)))) - (32 - 8 * uint32_t(sizeof(T)));
#else
  return uint32_t(std::countl_zero(bits));
#endif
}

/// The lowest bit that is set, of a value that is not 0.
template <std::unsigned_integral T>
UMBEL_HOST_DEVICE inline uint32_t lowest_bit(T bits) {
#if defined(__CUDA_ARCH__)
  if constexpr (sizeof(T) == 8) return uint32_t(__ffsll(static_cast<long long>(bits))) - 1;
  return uint32_t(__ffs(int(uint32_t(bits)))) - 1;
#else
  return uint32_t(std::countr_zero(bits));
#endif
}

/// The highest bit that is set, of a value that is not 0.
template <std::unsigned_integral T>
UMBEL_HOST_DEVICE inline uint32_t highest_bit(T bits) {
  return 8 * uint32_t(sizeof(T)) - 1 - leading_zeros(bits);
}

}  // namespace umbel
