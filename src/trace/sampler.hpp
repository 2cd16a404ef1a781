// Sample points of a path: for every pixel and dimension a two-dimensional Sobol sequence of its
// own, shuffled and scrambled by hashes, so that a point depends on (seed, pixel, sample,
// dimension) alone and the points of one dimension are stratified over the samples.
//
// Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020. The second coordinate's
// generator matrix is Pascal's triangle modulo 2, a Kronecker power, which is applied in five
// steps instead of 32.
#pragma once

#include <cstdint>

#include "umbel/types.hpp"

namespace umbel::trace {

inline uint32_t hash32(uint32_t x) {
  x ^= x >> 16;
  x *= 0x21f0aaadu;
  x ^= x >> 15;
  x *= 0xd35a2d97u;
  x ^= x >> 15;
  return x;
}

inline uint32_t combine(uint32_t a, uint32_t b) {
  return hash32(a ^ (b * 0x9e3779b9u + 0x7f4a7c15u));
}

inline uint32_t reverse_bits(uint32_t x) {
  x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
  x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
  x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
  x = (x >> 8 & 0x00ff00ffu) | (x & 0x00ff00ffu) << 8;
  return x >> 16 | x << 16;
}

/// A scramble in which a bit is flipped by what stands in lower bits only (Laine & Karras 2011).
inline uint32_t scramble_upwards(uint32_t x, uint32_t seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

/// The digits of the second Sobol coordinate of an index, the first in bit 0: the sum modulo 2 of
/// the index's bits whose position's own bits include the digit's.
inline uint32_t sobol_second(uint32_t index) {
  index ^= index >> 16 & 0x0000ffffu;
  index ^= index >> 8 & 0x00ff00ffu;
  index ^= index >> 4 & 0x0f0f0f0fu;
  index ^= index >> 2 & 0x33333333u;
  return index ^ (index >> 1 & 0x55555555u);
}

/// [0, 1) from the upper 24 bits.
inline float unit_float(uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

class Sampler {
 public:
  Sampler(uint32_t seed, uint32_t pixel, uint32_t sample)
      : pixel_seed_(combine(hash32(seed), pixel)), reversed_sample_(reverse_bits(sample)) {}

  /// The point of a dimension, in [0, 1) x [0, 1).
  Vec2 point(uint32_t dimension) const {
    const uint32_t seed = combine(pixel_seed_, dimension);
    // Shuffling the order of a sequence is scrambling its indices.
    const uint32_t index = reverse_bits(scramble_upwards(reversed_sample_, seed));
    const uint32_t u = reverse_bits(scramble_upwards(index, hash32(seed ^ 0x68bc21ebu)));
    const uint32_t v =
        reverse_bits(scramble_upwards(sobol_second(index), hash32(seed ^ 0x02e5be93u)));
    return {unit_float(u), unit_float(v)};
  }

 private:
  uint32_t pixel_seed_;
  uint32_t reversed_sample_;
};

}  // namespace umbel::trace
