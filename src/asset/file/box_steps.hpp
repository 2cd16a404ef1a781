// Boxes in 12 bytes: each corner coordinate as one of 65,536 steps across the box of everything.
#pragma once

#include <array>
#include <cstdint>

#include "umbel/types.hpp"

namespace umbel::asset {

/// The lowest corner's steps and the highest's. Their box contains `box`, which lies within
/// `bounds`, and is at most a step larger on each side.
std::array<uint16_t, 6> box_steps(const Aabb& box, const Aabb& bounds);
Aabb box_of_steps(const std::array<uint16_t, 6>& steps, const Aabb& bounds);

}  // namespace umbel::asset
