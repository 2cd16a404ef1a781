// What every search for closest points does alike, on processors and devices: see
// closest_point.hpp.
#pragma once

#include <bit>

#include "base/math.hpp"
#include "query/triangle_geometry.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::closest {

/// The power of two that brings a coordinate, unless it is too small, to between 1 and 4.
UMBEL_HOST_DEVICE inline float unit_scale(float largest) {
  const uint32_t exponent = std::bit_cast<uint32_t>(largest) >> 23;
  return std::bit_cast<float>((254u - std::clamp(exponent, 1u, 253u)) << 23);
}

UMBEL_HOST_DEVICE inline float largest_coordinate(const Vec3& p) {
  return std::max(std::max(std::abs(p.x), std::abs(p.y)), std::abs(p.z));
}

/// Squared distances of boxes, scaled and rounded, against the limit that a squared distance of
/// triangles, rounded otherwise, sets: with these margins no box is left out that has an equal in
/// it.
UMBEL_HOST_DEVICE inline float box_limit(double distance2, float unit) {
  constexpr double kRelativeMargin = 4e-6, kAbsoluteMargin = 1e-13;
  const double scale = unit;
  return static_cast<float>(distance2 * scale * scale * (1 + kRelativeMargin) + kAbsoluteMargin);
}

UMBEL_HOST_DEVICE inline ClosestPoint closest_at(const TrianglePoint& best, uint32_t primitive,
                                                 const Vec3& p0, const Vec3& p1, const Vec3& p2) {
  const Vec3d a = to_double(p0);
  const Vec3d p = a + (to_double(p1) - a) * best.u + (to_double(p2) - a) * best.v;
  const double distance = std::sqrt(best.distance2);
  const double most = std::numeric_limits<float>::max();
  return {{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)},
          static_cast<float>(distance < most ? distance : most),
          primitive,
          static_cast<float>(best.u),
          static_cast<float>(best.v)};
}

}  // namespace umbel::closest
