#include "trace/refraction.hpp"

#include "trace/microfacet.hpp"
#include "trace/sampler.hpp"

namespace umbel::trace {
namespace {

constexpr uint32_t kSamples = 128;

std::array<float, 5> integrate(float cosine, float roughness, float eta) {
  const float alpha = alpha_of(roughness);
  const Vec3 wo{std::sqrt(1.0f - cosine * cosine), 0.0f, cosine};
  const float lambda_o = smith_lambda(wo, alpha);
  std::array<double, 5> sums{};
  for (uint32_t i = 0; i < kSamples; ++i) {
    const Vec2 u{(static_cast<float>(i) + 0.5f) / kSamples, unit_float(reverse_bits(i))};
    const Vec3 h = visible_facet(wo, alpha, u);
    bool all_reflected = false;
    const float grazing = grazing_part(dot(wo, h), eta, all_reflected);
    const Vec3 wi = mirrored(wo, h);
    if (wi.z > 0.0f) {
      const float g = (1.0f + lambda_o) / (1.0f + lambda_o + smith_lambda(wi, alpha));
      sums[0] += all_reflected ? 0.0f : g * (1.0f - grazing);
      sums[1] += all_reflected ? 0.0f : g * grazing;
      sums[2] += all_reflected ? g : 0.0f;
    }
    if (all_reflected) continue;
    const Vec3 through = refracted(wo, h, eta, refracted_cosine(dot(wo, h), eta).value_or(0.0f));
    if (through.z >= 0.0f) continue;
    const float g = 1.0f / (1.0f + smith_lambda(through, alpha));
    sums[3] += g * (1.0f - grazing);
    sums[4] += g * grazing;
  }
  std::array<float, 5> means{};
  for (size_t k = 0; k < means.size(); ++k) means[k] = static_cast<float>(sums[k] / kSamples);
  return means;
}

}  // namespace

float grazing_part(float cosine, float eta, bool& all_reflected) {
  if (eta >= 1.0f) return schlick(cosine);
  const std::optional<float> behind = refracted_cosine(cosine, eta);
  all_reflected = !behind;
  return behind ? schlick(*behind) : 1.0f;
}

BodyAlbedos::BodyAlbedos(float ior)
    : ior_(ior),
      outside_([=](float c, float r) { return integrate(c, r, ior); }),
      inside_([=](float c, float r) { return integrate(c, r, 1.0f / ior); }) {}

BodyAlbedo BodyAlbedos::lookup(float cosine, float roughness, bool inside) const {
  const auto [a, b, c, through_a, through_b] =
      (inside ? inside_ : outside_).lookup(cosine, roughness);
  return {a, b, c, through_a, through_b};
}

}  // namespace umbel::trace
