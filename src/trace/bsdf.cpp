// Lambert plus GGX. The light that Smith's model loses between facets is put back by a factor
// (Turquin, "Practical multiple scattering compensation for microfacet models", 2019), and what the
// reflection sends on never reaches the diffuse layer.
#include "trace/bsdf.hpp"

namespace umbel::trace {

Bsdf::Bsdf(const SurfaceColor& color, const Vec3& wo) : wo_(wo) {
  diffuse_ = color.base * (1.0f - color.metallic);
  if (color.metallic <= 0.0f && color.specular <= 0.0f) return;
  alpha_ = alpha_of(color.roughness);
  f0_ = lerp(color.f0 * color.specular, color.base, color.metallic);
  const float f90 = color.f90 * color.specular;
  f90_ = f90 + (1.0f - f90) * color.metallic;
  const ReflectionAlbedo tabled = reflection_albedo(wo.z, color.roughness);
  const Vec3 one{1, 1, 1};
  gain_ = bounce_gain(f0_, tabled);
  const Vec3 single = f0_ * tabled.a + one * (f90_ * tabled.b);
  const Vec3 albedo = min(single * gain_, one);
  diffuse_ = diffuse_ * (one - albedo);
  const float reflected = luminance(albedo), scattered = luminance(diffuse_);
  const float sum = reflected + scattered;
  // A lower bound for both, so that no lobe is sampled too rarely.
  reflect_ = sum > 0.0f ? std::clamp(reflected / sum, 0.1f, 0.9f) : 0.5f;
  if (scattered <= 0.0f) reflect_ = 1.0f;
}

BsdfValue Bsdf::evaluate(const Vec3& wi) const {
  if (wi.z <= 0.0f || wo_.z <= 0.0f) return {{0, 0, 0}, 0.0f};
  BsdfValue result{diffuse_ * (wi.z / kPi), (1.0f - reflect_) * wi.z / kPi};
  if (reflect_ <= 0.0f) return result;
  const Vec3 h = normalized(wo_ + wi, {0, 0, 1});
  const float d = ggx(h, alpha_);
  const float lambda_o = smith_lambda(wo_, alpha_), lambda_i = smith_lambda(wi, alpha_);
  const float grazing = schlick(dot(wo_, h));
  const Vec3 fresnel = f0_ * (1.0f - grazing) + Vec3{f90_, f90_, f90_} * grazing;
  const float common = d / (4.0f * wo_.z);
  result.value += fresnel * gain_ * (common / (1.0f + lambda_o + lambda_i));
  result.density += reflect_ * common / (1.0f + lambda_o);
  return result;
}

BsdfSample Bsdf::sample(const Vec2& u, float choice) const {
  Vec3 wi;
  if (choice < reflect_) {
    const Vec3 h = visible_facet(wo_, alpha_, u);
    wi = mirrored(wo_, h);
  } else {
    wi = by_cosine(u);
    if (reflect_ <= 0.0f) return {wi, diffuse_, wi.z / kPi};
  }
  const BsdfValue found = evaluate(wi);
  if (!(found.density > 0.0f)) return {wi, {0, 0, 0}, 0.0f};
  return {wi, found.value * (1.0f / found.density), found.density};
}

}  // namespace umbel::trace
