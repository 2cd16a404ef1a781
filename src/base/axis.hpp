// Coordinates by the number of their axis.
#pragma once

#include <cstdint>

#include "base/host_device.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// The coordinate along axis 0, 1 or 2.
UMBEL_HOST_DEVICE inline float component(const Vec3& v, uint32_t axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}
UMBEL_HOST_DEVICE inline float& component(Vec3& v, uint32_t axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

}  // namespace umbel
