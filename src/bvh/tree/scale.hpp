// Builders compute areas and squared distances in floats, so they work on boxes of moderate size.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/math.hpp"
#include "umbel/types.hpp"

namespace umbel::bvh {

/// The power of two that brings the largest coordinate to between 1 and 2, or 1 where it is within
/// [1e-6, 1e6] already. Nothing is moved, so what floats can tell apart stays apart.
inline float moderate_scale(const Aabb& bounds) {
  const Vec3 low = bounds.min, high = bounds.max;
  const float largest = std::max({std::fabs(low.x), std::fabs(low.y), std::fabs(low.z),
                                  std::fabs(high.x), std::fabs(high.y), std::fabs(high.z)});
  if (largest == 0 || (largest >= 1e-6f && largest <= 1e6f)) return 1.0f;
  return std::ldexp(1.0f, std::clamp(-std::ilogb(largest), -126, 126));
}

inline Aabb scaled(const Aabb& box, float scale) { return {box.min * scale, box.max * scale}; }

}  // namespace umbel::bvh
