// Each layer is multiplied by what the albedo of those above leaves (as in Kulla & Conty,
// "Revisiting Physically Based Shading at Imageworks", 2017), so that white layers lose nothing.
#include "trace/layered_bsdf.hpp"

#include "trace/iridescence.hpp"
#include "trace/sheen.hpp"

namespace umbel::trace {
namespace {

constexpr Vec3 kOne{1, 1, 1};
constexpr float kCoatReflectance = 0.04f;
constexpr float kLeastChance = 0.1f;

Vec3 ratio(const Vec3& a, const Vec3& b) {
  const auto of = [](float x, float y) { return y > 1e-4f ? x / y : 0.0f; };
  return {of(a.x, b.x), of(a.y, b.y), of(a.z, b.z)};
}

}  // namespace

LayeredBsdf::LayeredBsdf(const SurfaceColor& color, const SurfaceLayers& layers, const Vec3& wo)
    : wo_(wo) {
  alpha_ = alpha_of(color.roughness);
  lambda_o_ = smith_lambda(wo, alpha_);
  lay_reflection(color, layers);
  lay_top(layers);
  choose_lobes();
}

/// The reflection and what is below it.
void LayeredBsdf::lay_reflection(const SurfaceColor& color, const SurfaceLayers& layers) {
  f0_ = lerp(color.f0 * color.specular, color.base, color.metallic);
  const float f90 = color.f90 * color.specular;
  f90_ = f90 + (1.0f - f90) * color.metallic;
  if (layers.film > 0.0f) {
    const Vec3 film = film_reflectance(wo_.z, layers.film_ior, layers.film_thickness, f0_);
    f0_ = lerp(f0_, film, layers.film);
    f90_ += (1.0f - f90_) * layers.film;
  }
  const ReflectionAlbedo plain = reflection_albedo(wo_.z, color.roughness);
  gain_ = bounce_gain(f0_, plain);
  BodyAlbedo tabled{plain.a, plain.b, 0.0f, plain.a, plain.b};
  if (layers.body) {
    tabled = layers.body->lookup(wo_.z, color.roughness, layers.inside);
    eta_ = layers.inside ? 1.0f / layers.body->ior() : layers.body->ior();
    thin_ = false;
  }
  const Vec3 single = f0_ * tabled.a + kOne * (f90_ * tabled.b + tabled.c);
  const Vec3 single_through =
      (kOne - f0_) * tabled.through_a + kOne * ((1.0f - f90_) * tabled.through_b);
  // What one bounce loses at a body's surface goes on both ways.
  if (layers.body) gain_ = ratio(kOne, single + single_through);
  const Vec3 albedo = min(single * gain_, kOne), rest = kOne - albedo;
  albedos_[kReflection] = luminance(albedo);

  const float below = 1.0f - color.metallic, through = below * layers.transmission;
  const Vec3 diffuse = rest * (below - through);
  diffuse_ = color.base * diffuse * (1.0f - layers.diffuse_transmission);
  diffuse_through_ = layers.diffuse_transmission_color * diffuse * layers.diffuse_transmission;
  const Vec3 passing = layers.passing * through;
  if (layers.straight) {
    straight_ = passing * rest;
    return;
  }
  through_ = passing * ratio(rest, single_through);
  albedos_[kThrough] = luminance(min(through_ * single_through, kOne));
}

/// Sheen and coat, and the light that they leave to the rest.
void LayeredBsdf::lay_top(const SurfaceLayers& layers) {
  float rest = 1.0f;
  if (!is_black(layers.sheen)) {
    sheen_ = layers.sheen;
    sheen_roughness_ = layers.sheen_roughness;
    rest = 1.0f - max_component(sheen_) * sheen_albedo(wo_.z, sheen_roughness_);
  }
  float under_coat = 1.0f;
  coat_basis_ = basis_around(layers.coat_normal);
  coat_wo_ = coat_basis_.to_local(wo_);
  if (layers.coat > 0.0f && coat_wo_.z > 0.0f) {
    coat_alpha_ = alpha_of(layers.coat_roughness);
    coat_lambda_o_ = smith_lambda(coat_wo_, coat_alpha_);
    const ReflectionAlbedo tabled = reflection_albedo(coat_wo_.z, layers.coat_roughness);
    coat_ = layers.coat * bounce_gain(kOne * kCoatReflectance, tabled).x;
    albedos_[kCoat] = coat_ * (kCoatReflectance * tabled.a + tabled.b);
    under_coat = std::max(0.0f, 1.0f - albedos_[kCoat]);
  }
  sheen_ = sheen_ * under_coat;
  rest *= under_coat;
  for (Vec3* lobe : {&gain_, &diffuse_, &diffuse_through_, &through_, &straight_})
    *lobe = *lobe * rest;
  albedos_[kReflection] *= rest;
  albedos_[kThrough] *= rest;
  albedos_[kDiffuse] = luminance(diffuse_) + luminance(sheen_);
  albedos_[kDiffuseThrough] = luminance(diffuse_through_);
}

/// Lobes are chosen in proportion to their albedos, with a lower bound.
void LayeredBsdf::choose_lobes() {
  float sum = 0.0f, raised = 0.0f;
  for (const float albedo : albedos_) sum += albedo;
  if (!(sum > 0.0f)) return;
  for (size_t k = 0; k < kLobes; ++k)
    if (albedos_[k] > 0.0f) raised += chances_[k] = std::max(albedos_[k] / sum, kLeastChance);
  for (float& chance : chances_) chance /= raised;
}

Vec3 LayeredBsdf::fresnel(float cosine) const {
  bool all_reflected = false;
  const float grazing = grazing_part(cosine, eta_, all_reflected);
  if (all_reflected) return kOne;
  return f0_ * (1.0f - grazing) + kOne * (f90_ * grazing);
}

void LayeredBsdf::add_reflection(const Vec3& wi, BsdfValue& sum) const {
  const Vec3 h = normalized(wo_ + wi, {0, 0, 1});
  const float common = ggx(h, alpha_) / (4.0f * wo_.z);
  const float lambda_i = smith_lambda(wi, alpha_);
  sum.value += fresnel(dot(wo_, h)) * gain_ * (common / (1.0f + lambda_o_ + lambda_i));
  sum.density += chances_[kReflection] * common / (1.0f + lambda_o_);
}

void LayeredBsdf::add_coat(const Vec3& wi, BsdfValue& sum) const {
  const Vec3 in = coat_basis_.to_local(wi);
  if (in.z <= 0.0f) return;
  const Vec3 h = normalized(coat_wo_ + in, {0, 0, 1});
  const float common = ggx(h, coat_alpha_) / (4.0f * coat_wo_.z);
  const float grazing = schlick(dot(coat_wo_, h));
  const float reflected = kCoatReflectance + (1.0f - kCoatReflectance) * grazing;
  const float shadowed = 1.0f + coat_lambda_o_ + smith_lambda(in, coat_alpha_);
  sum.value += kOne * (coat_ * reflected * common / shadowed);
  sum.density += chances_[kCoat] * common / (1.0f + coat_lambda_o_);
}

void LayeredBsdf::add_through(const Vec3& wi, BsdfValue& sum) const {
  if (thin_) {
    // As if reflected, then mirrored to the other side.
    const Vec3 up{wi.x, wi.y, -wi.z};
    const Vec3 h = normalized(wo_ + up, {0, 0, 1});
    const float common = ggx(h, alpha_) / (4.0f * wo_.z);
    const float shadowed = 1.0f + lambda_o_ + smith_lambda(up, alpha_);
    sum.value += (kOne - fresnel(dot(wo_, h))) * through_ * (common / shadowed);
    sum.density += chances_[kThrough] * common / (1.0f + lambda_o_);
    return;
  }
  const std::optional<Vec3> h = refracting_facet(wo_, wi, eta_);
  if (!h) return;
  const float cosine_o = dot(wo_, *h), cosine_i = dot(wi, *h);
  const float stretch = eta_ / (cosine_o + eta_ * cosine_i);
  const float density =
      ggx(*h, alpha_) * cosine_o / (wo_.z * (1.0f + lambda_o_)) * stretch * stretch * -cosine_i;
  if (!std::isfinite(density)) return;
  const float shadowed = 1.0f + smith_lambda(wi, alpha_);
  sum.value += (kOne - fresnel(cosine_o)) * through_ * (density / shadowed);
  sum.density += chances_[kThrough] * density;
}

BsdfValue LayeredBsdf::evaluate(const Vec3& wi) const {
  BsdfValue sum{{0, 0, 0}, 0.0f};
  if (wo_.z <= 0.0f || wi.z == 0.0f) return sum;
  if (wi.z < 0.0f) {
    sum = {diffuse_through_ * (-wi.z / kPi), chances_[kDiffuseThrough] * -wi.z / kPi};
    if (chances_[kThrough] > 0.0f) add_through(wi, sum);
    return sum;
  }
  sum = {diffuse_ * (wi.z / kPi), chances_[kDiffuse] * wi.z / kPi};
  if (!is_black(sheen_)) sum.value += sheen_ * sheen_value(wo_, wi, sheen_roughness_);
  if (chances_[kReflection] > 0.0f) add_reflection(wi, sum);
  if (chances_[kCoat] > 0.0f) add_coat(wi, sum);
  return sum;
}

/// Zero where the lobe has none for these numbers.
Vec3 LayeredBsdf::direction(Lobe lobe, const Vec2& u) const {
  if (lobe == kCoat) {
    const Vec3 in = mirrored(coat_wo_, visible_facet(coat_wo_, coat_alpha_, u));
    const Vec3 wi = coat_basis_.to_world(in);
    return in.z > 0.0f && wi.z > 0.0f ? wi : Vec3{0, 0, 0};
  }
  if (lobe == kDiffuse) return by_cosine(u);
  if (lobe == kDiffuseThrough) return -by_cosine(u);
  const Vec3 h = visible_facet(wo_, alpha_, u);
  const Vec3 wi = mirrored(wo_, h);
  if (lobe == kReflection) return wi.z > 0.0f ? wi : Vec3{0, 0, 0};
  if (thin_) return wi.z > 0.0f ? Vec3{wi.x, wi.y, -wi.z} : Vec3{0, 0, 0};
  const std::optional<float> behind = refracted_cosine(dot(wo_, h), eta_);
  if (!behind) return {0, 0, 0};
  const Vec3 through = refracted(wo_, h, eta_, *behind);
  return through.z < 0.0f ? through : Vec3{0, 0, 0};
}

BsdfSample LayeredBsdf::sample(const Vec2& u, float choice) const {
  uint32_t lobe = 0;
  for (uint32_t k = 0; k < kLobes; ++k) {
    if (!(chances_[k] > 0.0f)) continue;
    lobe = k;
    if (choice < chances_[k]) break;
    choice -= chances_[k];
  }
  const Vec3 wi = direction(static_cast<Lobe>(lobe), u);
  const BsdfValue found = evaluate(wi);
  if (!(found.density > 0.0f)) return {wi, {0, 0, 0}, 0.0f};
  return {wi, found.value * (1.0f / found.density), found.density};
}

}  // namespace umbel::trace
