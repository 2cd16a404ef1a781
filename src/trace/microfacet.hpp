// GGX (Walter et al. 2007) with Smith's shadowing (Heitz 2014) in the basis in which the normal is
// z, Schlick's Fresnel term (1994), and the albedo of such a reflection.
#pragma once

#include "trace/albedo_grid.hpp"
#include "trace/vector.hpp"

namespace umbel::trace {

inline constexpr float kSmoothest = 0.03f;  // roughness; below it highlights outgrow floats

inline float alpha_of(float roughness) {
  const float r = std::clamp(roughness, kSmoothest, 1.0f);
  return r * r;
}

inline float schlick(float cosine) {
  const float m = std::clamp(1.0f - cosine, 0.0f, 1.0f), m2 = m * m;
  return m2 * m2 * m;
}

/// Smith's auxiliary function of a direction.
inline float smith_lambda(const Vec3& w, float alpha) {
  const float z2 = w.z * w.z;
  if (z2 <= 0.0f) return 1e9f;
  return 0.5f * (std::sqrt(1.0f + alpha * alpha * std::max(0.0f, 1.0f - z2) / z2) - 1.0f);
}

inline float ggx(const Vec3& h, float alpha) {
  const float a2 = alpha * alpha;
  const float sin2 = h.x * h.x + h.y * h.y;
  const float d = h.z * h.z * a2 + sin2;
  return a2 / (kPi * d * d);
}

/// A facet that is visible from wo, by spherical caps (Dupuy & Benyoub 2023).
inline Vec3 visible_facet(const Vec3& wo, float alpha, const Vec2& u) {
  const Vec3 stretched = normalized({alpha * wo.x, alpha * wo.y, wo.z}, {0, 0, 1});
  const float phi = 2.0f * kPi * u.x;
  const float z = (1.0f - u.y) * (1.0f + stretched.z) - stretched.z;
  const float r = std::sqrt(std::clamp(1.0f - z * z, 0.0f, 1.0f));
  const Vec3 h = Vec3{r * std::cos(phi), r * std::sin(phi), z} + stretched;
  return normalized({alpha * h.x, alpha * h.y, std::max(0.0f, h.z)}, {0, 0, 1});
}

inline Vec3 mirrored(const Vec3& wo, const Vec3& h) { return h * (2.0f * dot(wo, h)) - wo; }

/// A direction of the upper hemisphere with a density of its cosine over pi.
inline Vec3 by_cosine(const Vec2& u) {
  const Vec2 disc = on_disc(u);
  return {disc.x, disc.y, std::sqrt(std::max(1e-12f, 1.0f - disc.x * disc.x - disc.y * disc.y))};
}

/// The part A + B of the light from above that a rough reflection sends on, where A is to be
/// multiplied by the reflectance at normal incidence and B by that at grazing angles.
struct ReflectionAlbedo {
  float a, b;
};
/// Inline, because each hit calls it.
AlbedoGrid<2> reflection_table();
inline ReflectionAlbedo reflection_albedo(float cosine, float roughness) {
  static const AlbedoGrid<2> table = reflection_table();
  const auto [a, b] = table.lookup(cosine, roughness);
  return {a, b};
}

/// The factor of a reflection's value that accounts for light that bounces between facets.
inline Vec3 bounce_gain(const Vec3& f0, const ReflectionAlbedo& tabled) {
  const float whole = std::max(tabled.a + tabled.b, 1e-3f);
  return Vec3{1, 1, 1} + f0 * (1.0f / whole - 1.0f);
}

}  // namespace umbel::trace
