// Stable least-significant-digit radix sort of 64-bit words by a range of their bits.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/math.hpp"

namespace umbel {

/// A float's bits as an unsigned integer of the same order. Both zeros become the same key.
UMBEL_HOST_DEVICE inline uint32_t float_to_key(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(without_negative_zero(value));
  return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

/// Sorts `words` by bits [first_bit, last_bit), with `spare` of the same size as scratch memory.
/// Returns the array that holds the result, which is one of the two.
inline uint64_t* radix_sort(uint64_t* words, uint64_t* spare, size_t count, uint32_t first_bit,
                            uint32_t last_bit) {
  constexpr uint32_t kMaxDigit = 11;
  if (count < 2 || last_bit <= first_bit) return words;
  const uint32_t passes = (last_bit - first_bit + kMaxDigit - 1) / kMaxDigit;
  const uint32_t digit = (last_bit - first_bit + passes - 1) / passes;
  const uint64_t mask = (uint64_t(1) << digit) - 1;
  std::array<uint32_t, size_t(1) << kMaxDigit> offsets;
  for (uint32_t pass = 0; pass < passes; ++pass) {
    const uint32_t shift = first_bit + pass * digit;
    std::fill_n(offsets.begin(), size_t(1) << digit, 0u);
    for (size_t i = 0; i < count; ++i) ++offsets[(words[i] >> shift) & mask];
    if (offsets[(words[0] >> shift) & mask] == count) continue;
    uint32_t sum = 0;
    for (size_t d = 0; d <= mask; ++d) sum += std::exchange(offsets[d], sum);
    for (size_t i = 0; i < count; ++i) spare[offsets[(words[i] >> shift) & mask]++] = words[i];
    std::swap(words, spare);
  }
  return words;
}

}  // namespace umbel
