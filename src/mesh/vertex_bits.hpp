// Vertices as keys: compared by the bits of their values, with -0 counted as 0.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "base/hash.hpp"
#include "base/math.hpp"
#include "umbel/types.hpp"

namespace umbel {

template <typename Vector>
std::array<uint32_t, sizeof(Vector) / 4> value_bits(const Vector& v) {
  return std::bit_cast<std::array<uint32_t, sizeof(Vector) / 4>>(without_negative_zero(v));
}

template <typename Vector>
bool same_value(const Vector& a, const Vector& b) {
  return value_bits(a) == value_bits(b);
}

template <typename Vector>
uint64_t hash_value(const Vector& v, uint64_t seed) {
  const auto bits = value_bits(v);
  uint64_t hash = seed;
  for (size_t i = 0; i + 1 < bits.size(); i += 2)
    hash = mix64(hash ^ (bits[i] | uint64_t{bits[i + 1]} << 32));
  if constexpr (bits.size() % 2 == 1) hash = mix64(hash ^ bits.back());
  return hash;
}

/// For Interner.
struct ValueHash {
  template <typename Vector>
  uint64_t operator()(const Vector& v) const {
    return hash_value(v, 0);
  }
};

}  // namespace umbel
