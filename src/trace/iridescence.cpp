#include "trace/iridescence.hpp"

#include <array>

#include "trace/microfacet.hpp"

namespace umbel::trace {
namespace {

float square(float x) { return x * x; }

float reflectance(float ior_behind, float ior_before) {
  return square((ior_behind - ior_before) / (ior_behind + ior_before));
}

float with_schlick(float f0, float cosine) { return f0 + (1.0f - f0) * schlick(cosine); }

/// The spectrum's modulation by a path difference, as the eye's three receptors see it.
Vec3 sensitivity(float difference, const Vec3& shift) {
  const float phase = 2.0f * kPi * difference * 1e-9f;
  const auto bump = [&](float value, float position, float variance, float by) {
    return value * std::sqrt(2.0f * kPi * variance) * std::cos(position * phase + by) *
           std::exp(-square(phase) * variance);
  };
  const float x = bump(5.4856e-13f, 1.6810e+06f, 4.3278e+09f, shift.x) +
                  bump(9.7470e-14f, 2.2399e+06f, 4.5282e+09f, shift.x);
  const float y = bump(4.4201e-13f, 1.7953e+06f, 9.3046e+09f, shift.y);
  const float z = bump(5.2481e-13f, 2.2084e+06f, 6.6121e+09f, shift.z);
  return Vec3{3.2404542f * x - 1.5371385f * y - 0.4985314f * z,
              -0.9692660f * x + 1.8760108f * y + 0.0415560f * z,
              0.0556434f * x - 0.2040259f * y + 1.0572252f * z} *
         (1.0f / 1.0685e-7f);
}

Vec3 reflected(float cosine, float film_ior, float thickness, const Vec3& f0) {
  // A film that vanishes has no index of its own.
  const float t = std::clamp(thickness / 0.03f, 0.0f, 1.0f);
  const float ior = 1.0f + (film_ior - 1.0f) * t * t * (3.0f - 2.0f * t);
  const float cos2 = 1.0f - (1.0f - square(cosine)) / square(ior);
  if (cos2 < 0.0f) return {1, 1, 1};
  const float inner = std::sqrt(cos2);
  const float r12 = with_schlick(reflectance(ior, 1.0f), cosine), t121 = 1.0f - r12;
  std::array<float, 3> shifts{}, r23{};
  const std::array<float, 3> base{f0.x, f0.y, f0.z};
  for (size_t k = 0; k < 3; ++k) {
    const float root = std::sqrt(std::clamp(base[k] + 1e-4f, 0.0f, 0.9999f));
    const float base_ior = (1.0f + root) / (1.0f - root);
    r23[k] = with_schlick(reflectance(base_ior, ior), inner);
    shifts[k] = kPi + (base_ior < ior ? kPi : 0.0f);
  }
  const float difference = 2.0f * ior * thickness * inner;
  const auto per = [&](auto of) { return Vec3{of(r23[0]), of(r23[1]), of(r23[2])}; };
  const auto both = [&](float r) { return std::clamp(r12 * r, 1e-5f, 0.9999f); };
  const Vec3 series = per([&](float r) { return square(t121) * r / (1.0f - both(r)); });
  const Vec3 step = per([&](float r) { return std::sqrt(both(r)); });
  Vec3 total = series + Vec3{r12, r12, r12};
  Vec3 weight = series - Vec3{t121, t121, t121};
  for (int m = 1; m <= 2; ++m) {
    const auto order = static_cast<float>(m);
    weight = weight * step;
    total += weight *
             sensitivity(order * difference, Vec3{shifts[0], shifts[1], shifts[2]} * order) * 2.0f;
  }
  return total;
}

}  // namespace

Vec3 film_reflectance(float cosine, float film_ior, float thickness, const Vec3& f0) {
  const Vec3 seen = reflected(std::clamp(cosine, 0.0f, 1.0f), film_ior, thickness, f0);
  const float grazing = std::min(schlick(cosine), 0.9999f);
  const auto undone = [&](float f) {
    return std::clamp((f - grazing) / (1.0f - grazing), 0.0f, 1.0f);
  };
  return {undone(seen.x), undone(seen.y), undone(seen.z)};
}

}  // namespace umbel::trace
