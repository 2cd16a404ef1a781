// Where a file of slices has what one unit needs, so that a machine far away fetches that alone.
#pragma once

#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

namespace umbel::scale {

/// Stretches of bytes, from the first to one past the last. A file of the same size with nothing
/// but the common stretches and one unit's slice can be read for that unit.
struct SlicePlaces {
  uint64_t bytes = 0;  ///< of the file
  std::vector<std::pair<uint64_t, uint64_t>> common;
  std::vector<std::tuple<uint32_t, uint64_t, uint64_t>> slices;  ///< unit, begin, end
};

}  // namespace umbel::scale
