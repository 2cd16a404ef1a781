// Lambert plus GGX (Walter et al. 2007) with Smith's height-correlated shadowing (Heitz 2014) and
// Schlick's Fresnel term (1994). Visible facets are sampled by spherical caps (Dupuy & Benyoub
// 2023). The light that Smith's model loses between facets is put back by a factor (Turquin,
// "Practical multiple scattering compensation for microfacet models", 2019), and what the
// reflection sends on never reaches the diffuse layer. Both need the reflection's albedo, which is
// tabled by split sums (Karis 2013).
#include "trace/bsdf.hpp"

#include <array>

#include "trace/sampler.hpp"

namespace umbel::trace {
namespace {

constexpr float kSmoothest = 0.03f;  // roughness; below it highlights outgrow floats

float alpha_of(float roughness) {
  const float r = std::clamp(roughness, kSmoothest, 1.0f);
  return r * r;
}

float schlick(float cosine) {
  const float m = std::clamp(1.0f - cosine, 0.0f, 1.0f), m2 = m * m;
  return m2 * m2 * m;
}

/// Smith's auxiliary function of a direction.
float smith_lambda(const Vec3& w, float alpha) {
  const float z2 = w.z * w.z;
  if (z2 <= 0.0f) return 1e9f;
  return 0.5f * (std::sqrt(1.0f + alpha * alpha * std::max(0.0f, 1.0f - z2) / z2) - 1.0f);
}

float ggx(const Vec3& h, float alpha) {
  const float a2 = alpha * alpha;
  const float sin2 = h.x * h.x + h.y * h.y;
  const float d = h.z * h.z * a2 + sin2;
  return a2 / (kPi * d * d);
}

/// A facet that is visible from wo.
Vec3 visible_facet(const Vec3& wo, float alpha, const Vec2& u) {
  const Vec3 stretched = normalized({alpha * wo.x, alpha * wo.y, wo.z}, {0, 0, 1});
  const float phi = 2.0f * kPi * u.x;
  const float z = (1.0f - u.y) * (1.0f + stretched.z) - stretched.z;
  const float r = std::sqrt(std::clamp(1.0f - z * z, 0.0f, 1.0f));
  const Vec3 h = Vec3{r * std::cos(phi), r * std::sin(phi), z} + stretched;
  return normalized({alpha * h.x, alpha * h.y, std::max(0.0f, h.z)}, {0, 0, 1});
}

class AlbedoTable {
 public:
  AlbedoTable() {
    for (uint32_t r = 0; r < kSize; ++r)
      for (uint32_t c = 0; c < kSize; ++c)
        cells_[r][c] = integrate(at(c) < 1e-3f ? 1e-3f : at(c), alpha_of(at(r)));
  }

  ReflectionAlbedo lookup(float cosine, float roughness) const {
    const float x = std::clamp(cosine, 0.0f, 1.0f) * (kSize - 1);
    const float y = std::clamp(roughness, 0.0f, 1.0f) * (kSize - 1);
    const auto x0 = std::min(static_cast<uint32_t>(x), kSize - 2);
    const auto y0 = std::min(static_cast<uint32_t>(y), kSize - 2);
    const float tx = x - static_cast<float>(x0), ty = y - static_cast<float>(y0);
    const auto mix = [](const ReflectionAlbedo& p, const ReflectionAlbedo& q, float t) {
      return ReflectionAlbedo{p.a + (q.a - p.a) * t, p.b + (q.b - p.b) * t};
    };
    return mix(mix(cells_[y0][x0], cells_[y0][x0 + 1], tx),
               mix(cells_[y0 + 1][x0], cells_[y0 + 1][x0 + 1], tx), ty);
  }

 private:
  static constexpr uint32_t kSize = 32, kSamples = 256;

  static float at(uint32_t i) { return static_cast<float>(i) / (kSize - 1); }

  static ReflectionAlbedo integrate(float cosine, float alpha) {
    const Vec3 wo{std::sqrt(1.0f - cosine * cosine), 0.0f, cosine};
    const float lambda_o = smith_lambda(wo, alpha);
    double a = 0, b = 0;
    for (uint32_t i = 0; i < kSamples; ++i) {
      const Vec2 u{(static_cast<float>(i) + 0.5f) / kSamples, unit_float(reverse_bits(i))};
      const Vec3 h = visible_facet(wo, alpha, u);
      const Vec3 wi = h * (2.0f * dot(wo, h)) - wo;
      if (wi.z <= 0.0f) continue;
      const float g = (1.0f + lambda_o) / (1.0f + lambda_o + smith_lambda(wi, alpha));
      const float grazing = schlick(dot(wo, h));
      a += g * (1.0f - grazing);
      b += g * grazing;
    }
    return {static_cast<float>(a / kSamples), static_cast<float>(b / kSamples)};
  }

  std::array<std::array<ReflectionAlbedo, kSize>, kSize> cells_;
};

}  // namespace

ReflectionAlbedo reflection_albedo(float cosine, float roughness) {
  static const AlbedoTable table;
  return table.lookup(cosine, roughness);
}

Bsdf::Bsdf(const SurfaceColor& color, const Vec3& wo) : wo_(wo) {
  diffuse_ = color.base * (1.0f - color.metallic);
  if (color.metallic <= 0.0f && color.specular <= 0.0f) return;
  alpha_ = alpha_of(color.roughness);
  const float dielectric = 0.04f * color.specular;
  f0_ = lerp({dielectric, dielectric, dielectric}, color.base, color.metallic);
  f90_ = color.specular + (1.0f - color.specular) * color.metallic;
  const ReflectionAlbedo tabled = reflection_albedo(wo.z, color.roughness);
  const float whole = std::max(tabled.a + tabled.b, 1e-3f);
  const Vec3 one{1, 1, 1};
  gain_ = one + f0_ * (1.0f / whole - 1.0f);
  const Vec3 single = f0_ * tabled.a + one * (f90_ * tabled.b);
  const Vec3 albedo = min(single * gain_, one);
  diffuse_ = diffuse_ * (one - albedo);
  const float reflected = luminance(albedo), scattered = luminance(diffuse_);
  const float sum = reflected + scattered;
  // A share of each keeps what is rare from being found too rarely.
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
    wi = h * (2.0f * dot(wo_, h)) - wo_;
  } else {
    const Vec2 disc = on_disc(u);
    wi = {disc.x, disc.y, std::sqrt(std::max(1e-12f, 1.0f - disc.x * disc.x - disc.y * disc.y))};
    if (reflect_ <= 0.0f) return {wi, diffuse_, wi.z / kPi};
  }
  const BsdfValue found = evaluate(wi);
  if (!(found.density > 0.0f)) return {wi, {0, 0, 0}, 0.0f};
  return {wi, found.value * (1.0f / found.density), found.density};
}

}  // namespace umbel::trace
