// The parts of the tracer by themselves: sampler, alias table, sky, reflection, cameras.
#include <gtest/gtest.h>

#include <array>
#include <set>
#include <utility>

#include "trace/alias_table.hpp"
#include "trace/bsdf.hpp"
#include "trace/camera.hpp"
#include "trace/sampler.hpp"
#include "trace/scenes.hpp"
#include "trace/sky.hpp"

namespace umbel::trace {
namespace {

using namespace testing;

TEST(Sampler, points_of_a_dimension_are_a_net_in_base_two) {
  // Of each aligned 2^m samples one falls into each box of 2^-a by 2^-(m-a).
  for (const uint32_t pixel : {0u, 7u, 123456u}) {
    for (const uint32_t dimension : {0u, 1u, 90u}) {
      for (uint32_t m = 0; m <= 8; ++m) {
        for (uint32_t a = 0; a <= m; ++a) {
          std::set<std::pair<int, int>> boxes;
          for (uint32_t i = 0; i < 1u << m; ++i) {
            const Vec2 p = Sampler(1, pixel, (3u << m) + i).point(dimension);
            boxes.insert({static_cast<int>(p.x * static_cast<float>(1u << a)),
                          static_cast<int>(p.y * static_cast<float>(1u << (m - a)))});
          }
          EXPECT_EQ(boxes.size(), size_t{1} << m);
        }
      }
    }
  }
}

TEST(Sampler, seeds_pixels_and_dimensions_differ) {
  const auto same = [](const Vec2& a, const Vec2& b) { return a.x == b.x && a.y == b.y; };
  const Vec2 p = Sampler(1, 5, 9).point(2);
  EXPECT_TRUE(same(p, Sampler(1, 5, 9).point(2)));
  EXPECT_FALSE(same(p, Sampler(2, 5, 9).point(2)));
  EXPECT_FALSE(same(p, Sampler(1, 6, 9).point(2)));
  EXPECT_FALSE(same(p, Sampler(1, 5, 9).point(3)));
}

TEST(AliasTable, chooses_in_proportion_to_weights) {
  const std::array<double, 5> weights{1, 0, 3, 0.5, 5.5};
  const AliasTable table(weights);
  constexpr uint32_t kDraws = 1 << 16;
  std::array<double, 5> counts{}, rests{};
  for (uint32_t i = 0; i < kDraws; ++i) {
    const auto choice = table.choose((static_cast<float>(i) + 0.5f) / kDraws);
    ++counts[choice.index];
    rests[choice.index] += choice.rest;
    EXPECT_GE(choice.rest, 0.0f);
    EXPECT_LT(choice.rest, 1.0f);
  }
  for (size_t i = 0; i < weights.size(); ++i) {
    EXPECT_NEAR(counts[i] / kDraws, weights[i] / 10, 1e-3);
    if (counts[i] > 0) EXPECT_NEAR(rests[i] / counts[i], 0.5, 0.01);
  }
  EXPECT_TRUE(AliasTable(std::array<double, 2>{0, 0}).empty());
}

TEST(Sky, samples_have_the_density_and_radiance_that_it_states) {
  // The mean of radiance over density must be the integral over the sphere.
  const Sky sky(Environment{});
  double by_samples = 0, by_sphere = 0;
  constexpr uint32_t kSamples = 1 << 15;
  for (uint32_t i = 0; i < kSamples; ++i) {
    const Vec2 u = Sampler(1, 0, i).point(0);
    const LightSample s = sky.sample(u);
    EXPECT_NEAR(length(s.direction), 1.0f, 1e-4f);
    by_samples += s.radiance.y / s.density / kSamples;
    const float z = 1 - 2 * u.x, r = std::sqrt(std::max(0.0f, 1 - z * z));
    const float phi = 2 * kPi * u.y;
    by_sphere += sky.radiance({r * std::cos(phi), r * std::sin(phi), z}).y * 4 * kPi / kSamples;
  }
  EXPECT_NEAR(by_samples / by_sphere, 1.0, 0.01);
}

TEST(Sky, densities_of_all_directions_sum_up_to_one) {
  for (const Environment& environment : {Environment{}, constant(3)}) {
    const Sky sky(environment);
    double sum = 0;
    constexpr uint32_t kSamples = 1 << 18;
    for (uint32_t i = 0; i < kSamples; ++i) {
      const Vec2 u = Sampler(1, 0, i).point(0);
      const float z = 1 - 2 * u.x, r = std::sqrt(std::max(0.0f, 1 - z * z)), phi = 2 * kPi * u.y;
      sum += sky.density({r * std::cos(phi), r * std::sin(phi), z}) * 4 * kPi / kSamples;
    }
    EXPECT_NEAR(sum, 1.0, 2e-3);
  }
}

TEST(Sky, density_of_a_sampled_direction_is_the_sample_s) {
  const Sky sky(Environment{});
  uint32_t equal = 0;
  for (uint32_t i = 0; i < 4096; ++i) {
    const LightSample s = sky.sample(Sampler(3, 1, i).point(0));
    if (std::abs(sky.density(s.direction) - s.density) < 1e-3f * s.density) ++equal;
  }
  EXPECT_GT(equal, 4000u);  // rounding moves a few into the next cell
}

TEST(Sky, a_clear_sky_is_blue_above_and_bright_near_the_sun) {
  Environment environment;
  environment.sun_direction = {0, 1, 1};
  const Sky sky(environment);
  const Vec3 zenith = sky.radiance({0, 1, 0});
  EXPECT_GT(zenith.z, 1.3f * zenith.x);
  const float h = std::sqrt(0.5f);
  EXPECT_GT(sky.radiance({0, h, h}).y, 1.5f * sky.radiance({0, h, -h}).y);
  EXPECT_GT(sky.radiance({0, -1, 0}).y, 0.0f);
}

TEST(Sun, is_a_disc_of_the_asked_radius) {
  Environment environment;
  environment.sun_direction = {0, 1, 0};
  environment.sun_radius = 0.01f;
  const Sun sun(environment);
  const auto lit = [&](float angle) {
    return !is_black(sun.radiance({std::sin(angle), std::cos(angle), 0}));
  };
  EXPECT_TRUE(lit(0.0f));
  EXPECT_TRUE(lit(0.0097f));
  EXPECT_FALSE(lit(0.0103f));
  double irradiance = 0;
  for (uint32_t i = 0; i < 256; ++i) {
    const LightSample s = sun.sample(Sampler(1, 0, i).point(0));
    EXPECT_LT(std::acos(std::min(s.direction.y, 1.0f)), 0.0102f);
    irradiance += s.radiance.y / s.density / 256;
  }
  EXPECT_NEAR(sun.density() * 2 * kPi * (1 - std::cos(0.01)), 1.0, 1e-3);
  environment.sun_radius = 0.2f;  // larger, but not brighter on the whole
  const LightSample wide = Sun(environment).sample({0.3f, 0.8f});
  EXPECT_NEAR(wide.radiance.y / wide.density, irradiance, 1e-3 * irradiance);
}

TEST(Bsdf, samples_have_the_weight_and_density_that_evaluate_states) {
  for (const float roughness : {0.1f, 0.5f, 1.0f}) {
    const Vec3 wo = normalized({0.6f, 0.1f, 0.5f}, {0, 0, 1});
    const Bsdf bsdf({{0.8f, 0.5f, 0.2f}, 0.3f, roughness, 1.0f}, wo);
    double total = 0;
    for (uint32_t i = 0; i < 4096; ++i) {
      const Sampler sampler(1, 0, i);
      const BsdfSample s = bsdf.sample(sampler.point(0), sampler.point(1).x);
      if (!(s.density > 0)) continue;
      const BsdfValue v = bsdf.evaluate(s.direction);
      EXPECT_NEAR(v.density, s.density, 1e-4f * s.density);
      EXPECT_NEAR(v.value.x / v.density, s.weight.x, 1e-3f);
      total += 1.0 / 4096;
    }
    EXPECT_GT(total, 0.8);
    // Densities of a hemisphere sum up to what is not sampled below it.
    double sum = 0;
    for (uint32_t i = 0; i < 1 << 16; ++i) {
      const Vec2 u = Sampler(2, 0, i).point(0);
      const float r = std::sqrt(1 - u.x * u.x), phi = 2 * kPi * u.y;
      sum += bsdf.evaluate({r * std::cos(phi), r * std::sin(phi), u.x}).density * 2 * kPi / 65536;
    }
    EXPECT_NEAR(sum, total, 0.03);
  }
}

TEST(Bsdf, a_single_bounce_off_rough_metal_loses_what_the_factor_gives_back) {
  const ReflectionAlbedo rough = reflection_albedo(0.5f, 1.0f), smooth = reflection_albedo(0.5f, 0);
  EXPECT_LT(rough.a + rough.b, 0.85f);
  EXPECT_NEAR(smooth.a + smooth.b, 1.0f, 0.01f);
}

/// The place in the picture (0..1 each way) where a camera sees a point.
Vec2 seen_at(const Camera& camera, uint32_t width, uint32_t height, const Vec3& p) {
  const Vec3 forward = normalized(camera.target - camera.position, {0, 0, 0});
  const Vec3 right = normalized(cross(forward, camera.up), {0, 0, 0});
  const Vec3 up = cross(right, forward), way = p - camera.position;
  const float depth = dot(way, forward), t = std::tan(camera.fov_y / 2);
  EXPECT_GT(depth, 0.0f);
  return {0.5f + dot(way, right) / depth / t * static_cast<float>(height) / (2.0f * width),
          0.5f - dot(way, up) / depth / t / 2};
}

TEST(FitCamera, the_mesh_fills_the_picture_but_for_the_margin) {
  for (const auto& [width, height] : {std::pair{1024u, 768u}, std::pair{300u, 900u}}) {
    for (const float azimuth : {0.0f, 35.0f, 200.0f}) {
      const Mesh mesh = shapes::torus(24, 12);
      Viewpoint view;
      view.azimuth = azimuth;
      view.margin = 0.1f;
      const Camera camera = fit_camera(mesh.view(), {0, 1, 0}, width, height, view);
      Vec2 low{1, 1}, high{0, 0};
      for (const Vec3& p : mesh.positions) {
        const Vec2 s = seen_at(camera, width, height, p);
        low = {std::min(low.x, s.x), std::min(low.y, s.y)};
        high = {std::max(high.x, s.x), std::max(high.y, s.y)};
      }
      EXPECT_GE(std::min(low.x, low.y), 0.049f);
      EXPECT_LE(std::max(high.x, high.y), 0.951f);
      EXPECT_NEAR(std::max(high.x - low.x, high.y - low.y), 0.9f, 0.002f);
      // Along the side that is filled the mesh is in the middle.
      const bool wide = high.x - low.x > high.y - low.y;
      EXPECT_NEAR(wide ? low.x + high.x : low.y + high.y, 1.0f, 0.002f);
    }
  }
}

TEST(AutoCamera, goes_inside_rooms_and_stays_outside_of_solids) {
  // A box whose faces look inwards is a room, one whose faces look outwards a solid.
  Mesh box;
  for (int i = 0; i < 8; ++i)
    box.positions.push_back({i & 1 ? 4.f : -4.f, i & 2 ? 1.5f : -1.5f, i & 4 ? 2.f : -2.f});
  box.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1},
                   {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  const auto inside = [](const Camera& c) {
    return std::abs(c.position.x) < 4 && std::abs(c.position.y) < 1.5f &&
           std::abs(c.position.z) < 2;
  };
  const auto camera = [](const Mesh& mesh) {
    const Scene scene = scene_of(mesh, {}, Environment{});
    return auto_camera(scene, 64, 48);
  };
  EXPECT_TRUE(inside(camera(box)));
  for (const float size : {1e-25f, 1e25f}) {
    Mesh scaled = box;
    for (Vec3& p : scaled.positions) p = p * size;
    Camera found = camera(scaled);
    EXPECT_NE(found.position, found.target) << size;
    found.position = found.position * (1 / size);
    EXPECT_TRUE(inside(found)) << size;
  }
  for (Triangle& t : box.triangles) std::swap(t[1], t[2]);
  EXPECT_FALSE(inside(camera(box)));
}

TEST(RayCamera, a_lens_keeps_what_it_focuses_on_sharp) {
  Camera camera = from_above(10.0f, 0.5f);
  camera.lens_radius = 0.3f;
  const RayCamera lens(camera, 64, 64);
  camera.lens_radius = 0.0f;
  const Ray center = RayCamera(camera, 64, 64).ray(20.0f, 50.0f, {0, 0});
  const auto at_plane = [](const Ray& r) {
    const float t = -r.origin.z / r.direction.z;
    return Vec2{r.origin.x + t * r.direction.x, r.origin.y + t * r.direction.y};
  };
  for (const Vec2 u : {Vec2{0.1f, 0.9f}, Vec2{0.7f, 0.2f}}) {
    const Ray ray = lens.ray(20.0f, 50.0f, u);
    EXPECT_NE(ray.origin, center.origin);
    EXPECT_NEAR(at_plane(ray).x, at_plane(center).x, 1e-4f);
    EXPECT_NEAR(at_plane(ray).y, at_plane(center).y, 1e-4f);
  }
}

TEST(RayCamera, a_lens_focuses_at_the_target_in_scenes_of_any_size) {
  for (const float size : {1e-25f, 1.0f, 1e25f}) {
    Camera camera = from_above(10.0f * size, 0.5f);
    camera.lens_radius = 0.3f * size;
    const RayCamera lens(camera, 64, 64);
    camera.lens_radius = 0.0f;
    const Ray center = RayCamera(camera, 64, 64).ray(20.0f, 50.0f, {0, 0});
    const Ray ray = lens.ray(20.0f, 50.0f, {0.1f, 0.9f});
    const auto at_plane = [](const Ray& r) {
      return r.origin.x - r.origin.z / r.direction.z * r.direction.x;
    };
    EXPECT_NEAR(at_plane(ray) / size, at_plane(center) / size, 1e-4f) << size;
  }
}

}  // namespace
}  // namespace umbel::trace
