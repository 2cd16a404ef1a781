// The layers of glTF's extensions: no energy appears, white layers lose none, samples and densities
// agree, and light is bent as Snell says.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "trace/iridescence.hpp"
#include "trace/layered_bsdf.hpp"
#include "trace/sampler.hpp"
#include "trace/sheen.hpp"

namespace umbel::trace {
namespace {

const BodyAlbedos& glass() {
  static const BodyAlbedos albedos(1.5f);
  return albedos;
}

const BodyAlbedos& diamond() {
  static const BodyAlbedos albedos(2.42f);
  return albedos;
}

struct Case {
  std::string name;
  SurfaceLayers layers;
  float metallic = 0.0f;
};

std::vector<Case> cases() {
  std::vector<Case> all(1, Case{"plain", {}});
  const auto add = [&](const std::string& name, auto change, float metallic = 0.0f) {
    Case made{name, {}, metallic};
    change(made.layers);
    all.push_back(made);
  };
  add("coat", [](SurfaceLayers& l) { l.coat = 1.0f, l.coat_roughness = 0.3f; });
  add("rough coat", [](SurfaceLayers& l) { l.coat = 0.5f, l.coat_roughness = 0.7f; });
  add("coat on metal", [](SurfaceLayers& l) { l.coat = 1.0f, l.coat_roughness = 0.2f; }, 1.0f);
  add("sheen", [](SurfaceLayers& l) { l.sheen = {1, 1, 1}, l.sheen_roughness = 0.6f; });
  add("fine sheen", [](SurfaceLayers& l) { l.sheen = {1, 1, 1}, l.sheen_roughness = 0.2f; });
  add("thin", [](SurfaceLayers& l) { l.transmission = 1.0f; });
  add("partly thin", [](SurfaceLayers& l) { l.transmission = 0.4f; });
  add("through", [](SurfaceLayers& l) { l.diffuse_transmission = 0.7f; });
  add("film", [](SurfaceLayers& l) { l.film = 1.0f, l.film_thickness = 350.0f; });
  for (const bool inside : {false, true}) {
    const std::string side = inside ? " from inside" : "";
    const auto body = [&](const BodyAlbedos& of) {
      return [&of, inside](SurfaceLayers& l) {
        l.transmission = 1.0f, l.body = &of, l.inside = inside;
      };
    };
    add("glass" + side, body(glass()));
    add("diamond" + side, body(diamond()));
  }
  return all;
}

constexpr float kCosines[] = {0.08f, 0.3f, 0.6f, 0.95f};
constexpr float kRoughnesses[] = {0.0f, 0.15f, 0.4f, 0.7f, 1.0f};

Vec3 at_cosine(float cosine) { return {std::sqrt(1 - cosine * cosine), 0, cosine}; }

LayeredBsdf bsdf_of(const Case& c, float cosine, float roughness) {
  return {{{1, 1, 1}, c.metallic, roughness, 1.0f}, c.layers, at_cosine(cosine)};
}

/// The part of the light that is sent on, estimated as paths do.
double albedo_of(const LayeredBsdf& bsdf, uint32_t samples = 1 << 14) {
  double sum = 0;
  for (uint32_t i = 0; i < samples; ++i) {
    const Sampler sampler(7, 0, i);
    const BsdfSample s = bsdf.sample(sampler.point(0), sampler.point(1).x);
    if (s.density > 0) sum += luminance(s.weight);
  }
  return sum / samples + luminance(bsdf.straight());
}

TEST(LayeredBsdf, white_layers_send_on_all_of_the_light_and_no_more) {
  for (const Case& c : cases()) {
    for (const float roughness : kRoughnesses) {
      for (const float cosine : kCosines) {
        const double albedo = albedo_of(bsdf_of(c, cosine, roughness));
        EXPECT_LT(albedo, 1.02) << c.name << ", roughness " << roughness << ", cosine " << cosine;
        EXPECT_GT(albedo, 0.94) << c.name << ", roughness " << roughness << ", cosine " << cosine;
      }
    }
  }
}

TEST(LayeredBsdf, no_mixture_of_layers_sends_on_more_than_it_gets) {
  const BodyAlbedos* bodies[] = {nullptr, &glass(), &diamond()};
  for (uint32_t k = 0; k < 400; ++k) {
    uint32_t dimension = 0;
    const auto number = [&] { return Sampler(11, k, 0).point(dimension++).x; };
    const auto color = [&] { return Vec3{number(), number(), number()}; };
    const auto some = [&](float chance) { return number() < chance ? number() : 0.0f; };
    SurfaceLayers l;
    l.transmission = some(0.6f), l.passing = color();
    l.body = l.transmission > 0 ? bodies[k % 3] : nullptr;
    l.inside = l.body && number() < 0.5f;
    l.straight = !l.body && l.transmission > 0 && number() < 0.5f;
    l.diffuse_transmission = some(0.5f), l.diffuse_transmission_color = color();
    l.coat = some(0.6f), l.coat_roughness = number();
    l.coat_normal = normalized({0.6f * number() - 0.3f, 0.6f * number() - 0.3f, 1}, {0, 0, 1});
    l.sheen = color() * some(0.5f), l.sheen_roughness = number();
    l.film = some(0.5f), l.film_ior = 1 + 2 * number(), l.film_thickness = 1200 * number();
    const SurfaceColor surface{color(),  some(0.5f),         number(),
                               number(), color() * number(), number()};
    const LayeredBsdf bsdf(surface, l, at_cosine(0.02f + 0.97f * number()));
    Vec3 sum{0, 0, 0};
    constexpr uint32_t kSamples = 2048;
    for (uint32_t i = 0; i < kSamples; ++i) {
      const Sampler sampler(7, 0, i);
      const BsdfSample s = bsdf.sample(sampler.point(0), sampler.point(1).x);
      ASSERT_TRUE(is_finite(s.weight) && std::isfinite(s.density)) << k;
      ASSERT_GE(std::min({s.weight.x, s.weight.y, s.weight.z}), 0.0f) << k;
      if (s.density > 0) sum += s.weight * (1.0f / kSamples);
    }
    EXPECT_LT(max_component(sum + bsdf.straight()), 1.03f) << k;
  }
}

TEST(LayeredBsdf, samples_have_the_weight_and_density_that_evaluate_states) {
  for (const Case& c : cases()) {
    for (const float roughness : {0.4f, 1.0f}) {
      const LayeredBsdf bsdf = bsdf_of(c, 0.6f, roughness);
      double kept = 0;
      for (uint32_t i = 0; i < 4096; ++i) {
        const Sampler sampler(1, 0, i);
        const BsdfSample s = bsdf.sample(sampler.point(0), sampler.point(1).x);
        if (!(s.density > 0)) continue;
        kept += 1.0 / 4096;
        EXPECT_NEAR(bsdf.evaluate(s.direction).density, s.density, 1e-4f * s.density) << c.name;
      }
      // Densities over the sphere sum up to what was sampled at all.
      double sum = 0;
      constexpr uint32_t kPoints = 1 << 17;
      for (uint32_t i = 0; i < kPoints; ++i) {
        const Vec2 u = Sampler(2, 0, i).point(0);
        const float z = 2 * u.x - 1, r = std::sqrt(std::max(0.0f, 1 - z * z));
        const float phi = 2 * kPi * u.y;
        sum += bsdf.evaluate({r * std::cos(phi), r * std::sin(phi), z}).density;
      }
      EXPECT_NEAR(sum * 4 * kPi / kPoints, kept, 0.03) << c.name << ", roughness " << roughness;
    }
  }
}

TEST(LayeredBsdf, without_layers_is_the_plain_one) {
  const SurfaceColor color{{0.8f, 0.5f, 0.2f}, 0.3f, 0.5f, 1.0f};
  const Vec3 wo = at_cosine(0.6f);
  const Bsdf plain(color, wo);
  const LayeredBsdf layered(color, {}, wo);
  for (uint32_t i = 0; i < 64; ++i) {
    const Vec3 wi = by_cosine(Sampler(3, 0, i).point(0));
    const Vec3 a = plain.evaluate(wi).value, b = layered.evaluate(wi).value;
    EXPECT_NEAR(a.x, b.x, 1e-5f + 1e-4f * a.x);
    EXPECT_NEAR(a.z, b.z, 1e-5f + 1e-4f * a.z);
  }
}

TEST(LayeredBsdf, bends_light_as_snell_says) {
  for (const bool inside : {false, true}) {
    SurfaceLayers layers;
    layers.transmission = 1.0f, layers.body = &glass(), layers.inside = inside;
    const Vec3 wo = at_cosine(0.9f);
    const LayeredBsdf bsdf({{1, 1, 1}, 0, 0, 1}, layers, wo);
    uint32_t found = 0;
    for (uint32_t i = 0; i < 256; ++i) {
      const Sampler sampler(5, 0, i);
      const BsdfSample s = bsdf.sample(sampler.point(0), sampler.point(1).x);
      if (!(s.density > 0) || s.direction.z > 0) continue;
      ++found;
      EXPECT_NEAR(-s.direction.x, wo.x * (inside ? 1.5f : 1 / 1.5f), 0.02f);
      EXPECT_NEAR(s.direction.y, 0.0f, 0.02f);
    }
    EXPECT_GT(found, 128u);
  }
}

TEST(LayeredBsdf, beyond_the_critical_angle_all_is_reflected) {
  SurfaceLayers layers;
  layers.transmission = 1.0f, layers.body = &glass(), layers.inside = true;
  const LayeredBsdf bsdf({{1, 1, 1}, 0, 0, 1}, layers, at_cosine(0.5f));
  for (uint32_t i = 0; i < 256; ++i) {
    const Sampler sampler(5, 0, i);
    const BsdfSample s = bsdf.sample(sampler.point(0), sampler.point(1).x);
    if (s.density > 0 && s.direction.z < 0) EXPECT_LT(luminance(s.weight), 1e-3f);
  }
}

TEST(LayeredBsdf, refraction_is_the_same_both_ways_but_for_the_squared_index) {
  SurfaceLayers outside, inside;
  outside.transmission = inside.transmission = 1.0f;
  outside.body = inside.body = &glass();
  inside.inside = true;
  const SurfaceColor color{{1, 1, 1}, 0, 0.2f, 1};
  const Vec3 wo = at_cosine(0.8f), below = normalized({-0.45f, 0.05f, -0.9f}, {0, 0, 1});
  const Vec3 flipped_wo{wo.x, wo.y, -wo.z}, flipped{below.x, below.y, -below.z};
  const float in = LayeredBsdf(color, outside, wo).evaluate(below).value.x / -below.z;
  const float out = LayeredBsdf(color, inside, flipped).evaluate(flipped_wo).value.x / wo.z;
  EXPECT_GT(in, 0.1f);
  EXPECT_NEAR(in, out * 1.5f * 1.5f, 0.03f * in);
}

TEST(LayeredBsdf, a_smooth_thin_surface_lets_light_straight_through_and_nothing_else) {
  SurfaceLayers layers;
  layers.transmission = 1.0f, layers.straight = true, layers.passing = {0.5f, 1.0f, 0.25f};
  const LayeredBsdf bsdf({{0.5f, 1.0f, 0.25f}, 0, 0, 1}, layers, {0, 0, 1});
  EXPECT_NEAR(bsdf.straight().x, 0.5f * 0.96f, 0.01f);
  EXPECT_NEAR(bsdf.straight().y, 0.96f, 0.01f);
  EXPECT_NEAR(bsdf.straight().z, 0.25f * 0.96f, 0.01f);
  EXPECT_EQ(bsdf.evaluate({0, 0, -1}).density, 0.0f);
}

TEST(Sheen, sends_on_what_its_table_says) {
  for (const float roughness : {0.2f, 0.5f, 1.0f}) {
    for (const float cosine : kCosines) {
      double sum = 0;
      constexpr uint32_t kPoints = 1 << 14;
      for (uint32_t i = 0; i < kPoints; ++i) {
        const Vec3 wi = by_cosine(Sampler(2, 0, i).point(0));
        sum += sheen_value(at_cosine(cosine), wi, roughness) * kPi / wi.z / kPoints;
      }
      EXPECT_NEAR(sum, sheen_albedo(cosine, roughness), 0.05);
      EXPECT_LE(sheen_albedo(cosine, roughness), 1.0f);
    }
  }
}

TEST(Film, changes_colour_with_thickness_and_vanishes_without) {
  const Vec3 glass_like{0.04f, 0.04f, 0.04f};
  const Vec3 none = film_reflectance(1.0f, 1.8f, 0.0f, glass_like);
  EXPECT_NEAR(none.x, 0.04f, 0.01f);
  EXPECT_NEAR(none.z, 0.04f, 0.01f);
  const Vec3 thin = film_reflectance(1.0f, 1.8f, 200.0f, glass_like);
  const Vec3 thick = film_reflectance(1.0f, 1.8f, 350.0f, glass_like);
  EXPECT_GT(max_component(thin - thick), 0.03f);
  for (uint32_t step = 0; step < 30; ++step) {
    const float nanometres = 50.0f * static_cast<float>(step);
    for (const float cosine : {0.0f, 0.2f, 0.7f, 1.0f}) {
      const Vec3 f = film_reflectance(cosine, 2.0f, nanometres, {0.0f, 0.5f, 1.0f});
      EXPECT_GE(std::min({f.x, f.y, f.z}), 0.0f);
      EXPECT_LE(max_component(f), 1.0f);
    }
  }
}

}  // namespace
}  // namespace umbel::trace
