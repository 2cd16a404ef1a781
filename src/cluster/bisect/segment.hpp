// Items that are to be bisected by themselves, and where their clusters are written.
#pragma once

#include <cstdint>

#include "cluster/bisect/split_constraints.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {

/// Bisection rearranges items[0, count) into cluster order and sets first[i] to 1 where a cluster
/// begins, 0 elsewhere.
struct Segment {
  const Source& source;
  const SplitConstraints& constraints;
  uint32_t* items;
  uint8_t* first;
  uint32_t count;

  Segment part(uint32_t offset, uint32_t part_count) const {
    return {source, constraints, items + offset, first + offset, part_count};
  }
};

}  // namespace umbel::cluster
