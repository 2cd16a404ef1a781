// 64-bit hashing: XXH64 for bytes that are stored or compared between machines, and a mixer for
// tables in memory.
//
// XXH64 is written from its public specification: Yann Collet, "xxHash fast digest algorithm",
// version 0.1.1 (2018), doc/xxhash_spec.md of the xxHash project. The mixer is the finaliser of
// SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/bytes.hpp"
#include "base/host_device.hpp"

namespace umbel {

/// Every bit of the result depends on every bit of `x`; a bijection.
UMBEL_HOST_DEVICE inline uint64_t mix64(uint64_t x) {
  x += 0x9E3779B97F4A7C15u;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

namespace detail {

inline constexpr uint64_t kPrime1 = 0x9E3779B185EBCA87u;
inline constexpr uint64_t kPrime2 = 0xC2B2AE3D27D4EB4Fu;
inline constexpr uint64_t kPrime3 = 0x165667B19E3779F9u;
inline constexpr uint64_t kPrime4 = 0x85EBCA77C2B2AE63u;
inline constexpr uint64_t kPrime5 = 0x27D4EB2F165667C5u;

template <typename Word>
Word read_little_endian(const unsigned char* p) {
  Word word;
  std::memcpy(&word, p, sizeof(Word));
  return little_endian(word);
}

inline uint64_t xxh64_round(uint64_t accumulator, uint64_t lane) {
  return std::rotl(accumulator + lane * kPrime2, 31) * kPrime1;
}

inline uint64_t xxh64_merge(uint64_t hash, uint64_t accumulator) {
  return (hash ^ xxh64_round(0, accumulator)) * kPrime1 + kPrime4;
}

inline uint64_t xxh64_tail(uint64_t hash, const unsigned char* p, size_t size) {
  for (; size >= 8; p += 8, size -= 8)
    hash =
        std::rotl(hash ^ xxh64_round(0, read_little_endian<uint64_t>(p)), 27) * kPrime1 + kPrime4;
  if (size >= 4) {
    hash ^= read_little_endian<uint32_t>(p) * kPrime1;
    hash = std::rotl(hash, 23) * kPrime2 + kPrime3;
    p += 4, size -= 4;
  }
  for (; size > 0; ++p, --size) hash = std::rotl(hash ^ (*p * kPrime5), 11) * kPrime1;
  hash = (hash ^ (hash >> 33)) * kPrime2;
  hash = (hash ^ (hash >> 29)) * kPrime3;
  return hash ^ (hash >> 32);
}

}  // namespace detail

/// XXH64 of `size` bytes: the same value on every machine.
inline uint64_t xxh64(const void* data, size_t size, uint64_t seed = 0) {
  using namespace detail;
  const auto* p = static_cast<const unsigned char*>(data);
  const size_t total = size;
  uint64_t hash = seed + kPrime5;
  if (size >= 32) {
    uint64_t a = seed + kPrime1 + kPrime2, b = seed + kPrime2, c = seed, d = seed - kPrime1;
    for (; size >= 32; p += 32, size -= 32) {
      a = xxh64_round(a, read_little_endian<uint64_t>(p));
      b = xxh64_round(b, read_little_endian<uint64_t>(p + 8));
      c = xxh64_round(c, read_little_endian<uint64_t>(p + 16));
      d = xxh64_round(d, read_little_endian<uint64_t>(p + 24));
    }
    hash = std::rotl(a, 1) + std::rotl(b, 7) + std::rotl(c, 12) + std::rotl(d, 18);
    hash = xxh64_merge(xxh64_merge(xxh64_merge(xxh64_merge(hash, a), b), c), d);
  }
  return xxh64_tail(hash + total, p, size);
}

}  // namespace umbel
