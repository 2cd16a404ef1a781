#pragma once

#include "machine.hpp"

namespace cooperative_groups {

struct grid_group {
  __attribute__((always_inline)) void sync() const { umbel::simt::meet_grid(); }
};
inline grid_group this_grid() { return {}; }

}  // namespace cooperative_groups
