// Disjoint sets: each element refers to its parent, a root to itself.
#pragma once

#include <cstdint>
#include <vector>

namespace umbel {

/// The root of the set that i is in. Halves the path to it.
inline uint32_t find_root(std::vector<uint32_t>& parents, uint32_t i) {
  while (parents[i] != i) i = parents[i] = parents[parents[i]];
  return i;
}

}  // namespace umbel
