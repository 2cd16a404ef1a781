// The BSDF of a surface with the layers of glTF's extensions: from the top a clear coat, a sheen, a
// reflection with or without a thin film, and below it diffuse reflection, diffuse transmission and
// transmission. Each layer gets the light that those above leave.
#pragma once

#include <array>

#include "trace/bsdf.hpp"
#include "trace/refraction.hpp"

namespace umbel::trace {

/// The layers of one point, on the side that is seen.
struct SurfaceLayers {
  float transmission = 0.0f;
  Vec3 passing{1, 1, 1};  ///< colour of transmitted light
  /// Through a thin surface so smooth that light keeps its direction: `straight` has it, and
  /// nothing else.
  bool straight = false;
  bool inside = false;  ///< seen from inside a body
  const BodyAlbedos* body = nullptr;

  float diffuse_transmission = 0.0f;
  Vec3 diffuse_transmission_color{1, 1, 1};

  float coat = 0.0f, coat_roughness = 0.0f;
  Vec3 coat_normal{0, 0, 1};  ///< in the basis in which the normal is z

  Vec3 sheen{0, 0, 0};
  float sheen_roughness = 0.0f;

  float film = 0.0f;
  float film_ior = 1.3f, film_thickness = 400.0f;
};

/// As Bsdf, with directions below the surface too.
class LayeredBsdf {
 public:
  static constexpr bool kTransmits = true;

  LayeredBsdf(const SurfaceColor& color, const SurfaceLayers& layers, const Vec3& wo);

  BsdfValue evaluate(const Vec3& wi) const;
  BsdfSample sample(const Vec2& u, float choice) const;
  /// The light that passes without a change of direction; not in `evaluate`.
  const Vec3& straight() const { return straight_; }

 private:
  enum Lobe : uint32_t { kReflection, kDiffuse, kDiffuseThrough, kThrough, kCoat, kLobes };

  void lay_reflection(const SurfaceColor& color, const SurfaceLayers& layers);
  void lay_top(const SurfaceLayers& layers);
  void choose_lobes();
  Vec3 fresnel(float cosine) const;
  void add_reflection(const Vec3& wi, BsdfValue& sum) const;
  void add_coat(const Vec3& wi, BsdfValue& sum) const;
  void add_through(const Vec3& wi, BsdfValue& sum) const;
  Vec3 direction(Lobe lobe, const Vec2& u) const;

  Vec3 wo_;
  float alpha_ = 1.0f, lambda_o_ = 0.0f;
  float eta_ = 1.0f;  ///< of what is behind over what is before; 1: a thin surface
  bool thin_ = true;
  Vec3 f0_{0, 0, 0}, gain_{0, 0, 0};
  float f90_ = 0.0f;
  Vec3 diffuse_{0, 0, 0}, diffuse_through_{0, 0, 0}, through_{0, 0, 0}, straight_{0, 0, 0};
  Vec3 sheen_{0, 0, 0};
  float sheen_roughness_ = 0.0f;
  float coat_ = 0.0f, coat_alpha_ = 1.0f, coat_lambda_o_ = 0.0f;
  Basis coat_basis_{};
  Vec3 coat_wo_{0, 0, 1};
  std::array<float, kLobes> albedos_{};  ///< of each lobe, roughly
  std::array<float, kLobes> chances_{};
};

}  // namespace umbel::trace
