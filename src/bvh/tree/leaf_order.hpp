// The order of the primitives in a leaf.
#pragma once

#include <algorithm>
#include <cstdint>

namespace umbel::bvh {

/// Ascending. Most leaves have few, whose order cannot be predicted: so up to four are sorted
/// without a branch.
inline void sort_leaf(uint32_t* primitives, uint32_t count) {
  if (count > 4) {
    std::sort(primitives, primitives + count);
    return;
  }
  const uint32_t last = count - 1;
  const uint32_t at1 = std::min(1u, last), at2 = std::min(2u, last);
  uint32_t a = primitives[0], b = primitives[at1], c = primitives[at2], d = primitives[last];
  b = count > 1 ? b : ~0u;
  c = count > 2 ? c : ~0u;
  d = count > 3 ? d : ~0u;
  const auto order = [](uint32_t& low, uint32_t& high) {
    const uint32_t least = std::min(low, high);
    high = std::max(low, high);
    low = least;
  };
  order(a, b);
  order(c, d);
  order(a, c);
  order(b, d);
  order(b, c);
  // What there are not come last, and are written over.
  primitives[last] = d;
  primitives[at2] = c;
  primitives[at1] = b;
  primitives[0] = a;
}

}  // namespace umbel::bvh
