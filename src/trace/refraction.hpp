// Refraction at the rough surface of a body (Walter et al., "Microfacet Models for
// Refraction through Rough Surfaces", 2007).
//
// Radiance is stored divided by the square of the medium's index, which refraction does not change:
// so surfaces multiply by fractions of energy only.
#pragma once

#include <optional>

#include "trace/albedo_grid.hpp"
#include "trace/vector.hpp"

namespace umbel::trace {

/// The cosine behind a surface of a ray that meets it at `cosine`, where `eta` is the index behind
/// over that before it; nothing where all is reflected.
inline std::optional<float> refracted_cosine(float cosine, float eta) {
  const float sin2 = (1.0f - cosine * cosine) / (eta * eta);
  if (sin2 >= 1.0f) return std::nullopt;
  return std::sqrt(1.0f - sin2);
}

/// The direction behind a facet from which light is refracted to wo.
inline Vec3 refracted(const Vec3& wo, const Vec3& h, float eta, float cosine_behind) {
  return h * (dot(wo, h) / eta - cosine_behind) - wo * (1.0f / eta);
}

/// The facet between wo above and wi below, or nothing.
inline std::optional<Vec3> refracting_facet(const Vec3& wo, const Vec3& wi, float eta) {
  Vec3 h = normalized(wo + wi * eta, {0, 0, 0});
  if (h.z < 0.0f) h = -h;
  if (!(dot(wo, h) > 0.0f) || !(dot(wi, h) < 0.0f)) return std::nullopt;
  return h;
}

/// Schlick's term by the cosine on the thinner side, 1 where all is reflected.
float grazing_part(float cosine, float eta, bool& all_reflected);

/// The light from above that one bounce at a surface reflects, f0 a + f90 b + c, and lets through,
/// (1 - f0) through_a + (1 - f90) through_b.
struct BodyAlbedo {
  float a, b, c, through_a, through_b;
};

/// Of the surface of a body of one index.
class BodyAlbedos {
 public:
  explicit BodyAlbedos(float ior);

  float ior() const { return ior_; }
  BodyAlbedo lookup(float cosine, float roughness, bool inside) const;

 private:
  float ior_;
  AlbedoGrid<5> outside_, inside_;
};

}  // namespace umbel::trace
