// Where radix trees over sorted Morton codes part, for any executor.
#pragma once

#include <bit>
#include <cstdint>

#include "base/host_device.hpp"

namespace umbel::bvh {

/// Leading bits that positions i and j > i have in common. Equal codes are told apart by position.
template <typename Key>
UMBEL_HOST_DEVICE inline int common_bits(const Key* codes, uint32_t i, uint32_t j) {
  const Key difference = codes[i] ^ codes[j];
  if (difference != 0) return std::countl_zero(difference);
  return int(sizeof(Key) * 8) + std::countl_zero(i ^ j);
}

/// Where the range [begin, end), of at least two codes, splits: the first position of the right
/// part.
template <typename Key>
UMBEL_HOST_DEVICE inline uint32_t radix_split(const Key* codes, uint32_t begin, uint32_t end) {
  const int common = common_bits(codes, begin, end - 1);
  uint32_t low = begin, high = end - 1;  // low shares more than that with begin, high does not
  while (high - low > 1) {
    const uint32_t middle = low + (high - low) / 2;
    (common_bits(codes, begin, middle) > common ? low : high) = middle;
  }
  return high;
}

}  // namespace umbel::bvh
