// The albedo of a reflection, tabled by split sums (Karis 2013).
#include "trace/microfacet.hpp"

#include "trace/sampler.hpp"

namespace umbel::trace {
namespace {

constexpr uint32_t kMicrofacetSamples = 256;

std::array<float, 2> integrate_microfacets(float cosine, float roughness) {
  const float alpha = alpha_of(roughness);
  const Vec3 wo{std::sqrt(1.0f - cosine * cosine), 0.0f, cosine};
  const float lambda_o = smith_lambda(wo, alpha);
  double a = 0, b = 0;
  for (uint32_t i = 0; i < kMicrofacetSamples; ++i) {
    const Vec2 u{(static_cast<float>(i) + 0.5f) / kMicrofacetSamples, unit_float(reverse_bits(i))};
    const Vec3 h = visible_facet(wo, alpha, u);
    const Vec3 wi = mirrored(wo, h);
    if (wi.z <= 0.0f) continue;
    const float g = (1.0f + lambda_o) / (1.0f + lambda_o + smith_lambda(wi, alpha));
    const float grazing = schlick(dot(wo, h));
    a += g * (1.0f - grazing);
    b += g * grazing;
  }
  return {static_cast<float>(a / kMicrofacetSamples), static_cast<float>(b / kMicrofacetSamples)};
}

}  // namespace

AlbedoGrid<2> reflection_table() { return AlbedoGrid<2>(integrate_microfacets); }

}  // namespace umbel::trace
