// Boxes in 12 bytes: 16-bit coordinates on a grid across the mesh's box.
#pragma once

#include <array>
#include <cstdint>

#include "umbel/types.hpp"

namespace umbel::asset {

/// The steps of the lowest and of the highest corner, rounded outward: their box contains `box`,
/// which lies within `bounds`, and is at most a step larger on each side.
std::array<uint16_t, 6> box_steps(const Aabb& box, const Aabb& bounds);
Aabb box_of_steps(const std::array<uint16_t, 6>& steps, const Aabb& bounds);

}  // namespace umbel::asset
