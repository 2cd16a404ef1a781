// Arithmetic on the public vector, box and sphere types.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>

#include "base/host_device.hpp"
#include "umbel/types.hpp"

namespace umbel {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

UMBEL_HOST_DEVICE inline Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
UMBEL_HOST_DEVICE inline Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
UMBEL_HOST_DEVICE inline Vec3 operator*(const Vec3& a, float s) {
  return {a.x * s, a.y * s, a.z * s};
}
UMBEL_HOST_DEVICE inline Vec3 operator*(float s, const Vec3& a) { return a * s; }

UMBEL_HOST_DEVICE inline float dot(const Vec3& a, const Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
UMBEL_HOST_DEVICE inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
UMBEL_HOST_DEVICE inline float length(const Vec3& a) { return std::sqrt(dot(a, a)); }

UMBEL_HOST_DEVICE inline Vec3 min(const Vec3& a, const Vec3& b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
UMBEL_HOST_DEVICE inline Vec3 max(const Vec3& a, const Vec3& b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}

/// The same floats with 0 for -0, which are equal but have other bits: of a float, a vector or a
/// box.
template <typename Floats>
UMBEL_HOST_DEVICE Floats without_negative_zero(const Floats& value) {
  constexpr size_t kFloatBytes = 4;
  auto floats = std::bit_cast<std::array<float, sizeof(Floats) / kFloatBytes>>(value);
  for (float& f : floats) f += 0.0f;
  return std::bit_cast<Floats>(floats);
}

UMBEL_HOST_DEVICE inline Vec3d to_double(const Vec3& a) { return {a.x, a.y, a.z}; }
UMBEL_HOST_DEVICE inline Vec3d operator+(const Vec3d& a, const Vec3d& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
UMBEL_HOST_DEVICE inline Vec3d operator-(const Vec3d& a, const Vec3d& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
UMBEL_HOST_DEVICE inline Vec3d operator*(const Vec3d& a, double s) {
  return {a.x * s, a.y * s, a.z * s};
}
UMBEL_HOST_DEVICE inline Vec3d operator*(double s, const Vec3d& a) { return a * s; }
UMBEL_HOST_DEVICE inline double dot(const Vec3d& a, const Vec3d& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
UMBEL_HOST_DEVICE inline double length(const Vec3d& a) { return std::sqrt(dot(a, a)); }
UMBEL_HOST_DEVICE inline Vec3d cross(const Vec3d& a, const Vec3d& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

UMBEL_HOST_DEVICE inline bool is_finite(const Vec3& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

UMBEL_HOST_DEVICE inline bool is_finite(const Vec3d& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

UMBEL_HOST_DEVICE inline bool is_empty(const Aabb& b) {
  return b.min.x > b.max.x || b.min.y > b.max.y || b.min.z > b.max.z;
}
UMBEL_HOST_DEVICE inline void extend(Aabb& b, const Vec3& p) {
  b.min = min(b.min, p);
  b.max = max(b.max, p);
}
UMBEL_HOST_DEVICE inline void extend(Aabb& b, const Aabb& o) {
  b.min = min(b.min, o.min);
  b.max = max(b.max, o.max);
}
// Halved before the sum, so that boxes near the largest float do not overflow.
UMBEL_HOST_DEVICE inline Vec3 center(const Aabb& b) { return b.min * 0.5f + b.max * 0.5f; }

/// Half the surface area; 0 for an empty box.
UMBEL_HOST_DEVICE inline float half_area(const Aabb& b) {
  if (is_empty(b)) return 0.0f;
  const Vec3 d = b.max - b.min;
  return d.x * d.y + d.y * d.z + d.z * d.x;
}

/// The smallest float that is not below `value`.
inline float round_up(double value) {
  if (value > std::numeric_limits<float>::max()) return kInfinity;
  const float nearest = static_cast<float>(value);
  if (nearest >= value) return nearest;
  return std::nextafter(nearest, kInfinity);
}

}  // namespace umbel
