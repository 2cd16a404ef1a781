// Nodes of boxes as vectors.
#pragma once

#include "base/simd/box4.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {

inline Node node_of(const Box4& box, uint32_t first, uint32_t count) {
  return {{box.low[0], box.low[1], box.low[2]},
          first,
          {-box.negated_high[0], -box.negated_high[1], -box.negated_high[2]},
          count};
}

}  // namespace umbel::bvh
