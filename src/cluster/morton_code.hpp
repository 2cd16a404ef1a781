// Morton codes: the bits of three grid coordinates interleaved, x highest.
#pragma once

#include <cstdint>

namespace umbel::cluster {

/// Spreads the low 10 bits so that two zero bits follow each.
inline uint32_t spread10(uint32_t x) {
  x = (x | x << 16) & 0x030000ffu;
  x = (x | x << 8) & 0x0300f00fu;
  x = (x | x << 4) & 0x030c30c3u;
  x = (x | x << 2) & 0x09249249u;
  return x;
}

inline uint32_t morton30(uint32_t x, uint32_t y, uint32_t z) {
  return spread10(x) << 2 | spread10(y) << 1 | spread10(z);
}

}  // namespace umbel::cluster
