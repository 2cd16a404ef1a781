#include "trace/sheen.hpp"

#include "trace/albedo_grid.hpp"
#include "trace/sampler.hpp"

namespace umbel::trace {
namespace {

constexpr float kSmoothestCloth = 0.07f;
constexpr uint32_t kSheenSamples = 256;

/// The curve of Estevez & Kulla's fit of shadowing.
float fitted(float x, float alpha) {
  const float t = (1.0f - alpha) * (1.0f - alpha);
  const auto between = [t](float low, float high) { return high + (low - high) * t; };
  const float a = between(25.3245f, 21.5473f), b = between(3.32435f, 3.82987f),
              c = between(0.16801f, 0.19823f), d = between(-1.27393f, -1.97760f),
              e = between(-4.85967f, -4.32054f);
  return a / (1.0f + b * std::pow(x, c)) + d * x + e;
}

float shadowing(float cosine, float alpha) {
  if (cosine < 0.5f) return std::exp(fitted(cosine, alpha));
  return std::exp(2.0f * fitted(0.5f, alpha) - fitted(1.0f - cosine, alpha));
}

float unbounded(const Vec3& wo, const Vec3& wi, float roughness) {
  const float r = std::max(roughness, kSmoothestCloth), alpha = r * r;
  const Vec3 h = normalized(wo + wi, {0, 0, 1});
  const float sine = std::sqrt(std::max(0.0f, 1.0f - h.z * h.z));
  const float d = (2.0f + 1.0f / alpha) * std::pow(sine, 1.0f / alpha) / (2.0f * kPi);
  const float shadowed = 1.0f + shadowing(wo.z, alpha) + shadowing(wi.z, alpha);
  return d / (shadowed * 4.0f * std::max(wo.z, 1e-3f));
}

std::array<float, 1> integrate_sheen(float cosine, float roughness) {
  const Vec3 wo{std::sqrt(1.0f - cosine * cosine), 0.0f, cosine};
  double sum = 0;
  for (uint32_t i = 0; i < kSheenSamples; ++i) {
    const float z = (static_cast<float>(i) + 0.5f) / kSheenSamples;
    const float r = std::sqrt(1.0f - z * z), phi = 2.0f * kPi * unit_float(reverse_bits(i));
    sum += unbounded(wo, {r * std::cos(phi), r * std::sin(phi), z}, roughness);
  }
  return {static_cast<float>(sum * 2.0 * kPi / kSheenSamples)};
}

float tabled(float cosine, float roughness) {
  static const AlbedoGrid<1> table(integrate_sheen);
  return table.lookup(cosine, roughness)[0];
}

}  // namespace

float sheen_value(const Vec3& wo, const Vec3& wi, float roughness) {
  // At grazing angles the model does not conserve energy.
  return unbounded(wo, wi, roughness) / std::max(1.0f, tabled(wo.z, roughness));
}

float sheen_albedo(float cosine, float roughness) {
  return std::min(1.0f, tabled(cosine, roughness));
}

}  // namespace umbel::trace
