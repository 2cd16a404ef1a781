// The part of bvh::check that holds for trees that lack primitives too.
#pragma once

#include <cstdint>

#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// As bvh::check, without asking whether every primitive is in the tree, and how often.
void check_structure(const Bvh2& tree, uint32_t primitive_count);

}  // namespace umbel::bvh
