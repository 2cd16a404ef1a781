// What a tracer does to vectors beyond base/math.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/math.hpp"
#include "umbel/types.hpp"

namespace umbel::trace {

inline constexpr float kPi = std::numbers::pi_v<float>;

inline Vec3 operator*(const Vec3& a, const Vec3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
inline Vec3& operator+=(Vec3& a, const Vec3& b) { return a = a + b; }
inline Vec3d& operator+=(Vec3d& a, const Vec3& b) { return a = a + to_double(b); }

inline float max_component(const Vec3& a) { return std::max({a.x, a.y, a.z}); }
inline float luminance(const Vec3& c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }
inline bool is_black(const Vec3& c) { return c.x == 0.0f && c.y == 0.0f && c.z == 0.0f; }
inline Vec3 lerp(const Vec3& a, const Vec3& b, float t) { return a * (1.0f - t) + b * t; }

/// Unit length, or `fallback` where there is no direction. Scaled first, so that lengths whose
/// squares are no floats do not matter.
inline Vec3 normalized(const Vec3& a, const Vec3& fallback) {
  const float largest = std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)});
  if (!(largest > 0.0f) || !is_finite(a)) return fallback;
  const Vec3 scaled{a.x / largest, a.y / largest, a.z / largest};
  return scaled * (1.0f / length(scaled));
}

/// Three unit vectors at right angles.
struct Basis {
  Vec3 x, y, z;
  Vec3 to_world(const Vec3& v) const { return x * v.x + y * v.y + z * v.z; }
  Vec3 to_local(const Vec3& v) const { return {dot(v, x), dot(v, y), dot(v, z)}; }
};

/// A basis around a unit vector (Duff et al., "Building an Orthonormal Basis, Revisited", 2017).
inline Basis basis_around(const Vec3& z) {
  const float sign = std::copysign(1.0f, z.z);
  const float a = -1.0f / (sign + z.z), b = z.x * z.y * a;
  return {{1.0f + sign * z.x * z.x * a, sign * b, -sign * z.x}, {b, sign + z.y * z.y * a, -z.y}, z};
}

/// A point of the unit disc from one of the unit square (Shirley & Chiu 1997).
inline Vec2 on_disc(const Vec2& u) {
  const float a = 2.0f * u.x - 1.0f, b = 2.0f * u.y - 1.0f;
  if (a == 0.0f && b == 0.0f) return {0.0f, 0.0f};
  const bool wide = std::abs(a) > std::abs(b);
  const float radius = wide ? a : b;
  const float angle = wide ? kPi / 4.0f * (b / a) : kPi / 2.0f - kPi / 4.0f * (a / b);
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

}  // namespace umbel::trace
