// The BSDF of a surface without layers: Lambert's diffuse reflection below a rough GGX reflection.
// It conserves energy, and loses none where colours are white.
#pragma once

#include "trace/microfacet.hpp"
#include "trace/vector.hpp"

namespace umbel::trace {

/// A material at one point.
struct SurfaceColor {
  Vec3 base;
  float metallic, roughness, specular;
  Vec3 f0{0.04f, 0.04f, 0.04f};  ///< a dielectric's reflectance at normal incidence, and
  float f90 = 1.0f;              ///< at grazing angles; both before `specular`
};

struct BsdfValue {
  Vec3 value;     ///< reflectance times the cosine
  float density;  ///< of sampling this direction, per steradian
};

struct BsdfSample {
  Vec3 direction;
  Vec3 weight;    ///< reflectance times the cosine over the density
  float density;  ///< 0: no direction; the path ends
};

/// For one point and the outgoing direction `wo`. Directions are in the basis in which the normal
/// is z, and point away from the surface.
class Bsdf {
 public:
  static constexpr bool kTransmits = false;

  Bsdf(const SurfaceColor& color, const Vec3& wo);

  BsdfValue evaluate(const Vec3& wi) const;
  BsdfSample sample(const Vec2& u, float choice) const;

 private:
  Vec3 wo_;
  Vec3 diffuse_;
  Vec3 f0_{0, 0, 0};
  Vec3 gain_{0, 0, 0};  ///< of the reflection, for what bounces between facets
  float f90_ = 0.0f;
  float alpha_ = 1.0f;
  float reflect_ = 0.0f;  ///< probability of sampling the reflection
};

}  // namespace umbel::trace
