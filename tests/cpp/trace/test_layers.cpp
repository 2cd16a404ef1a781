// Pictures of glass, coats, cloth and films that are known, or to be equal to each other.
#include <gtest/gtest.h>

#include <iterator>
#include <numbers>
#include <utility>

#include "trace/scenes.hpp"
#include "trace/vector.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {
namespace {

using namespace testing;

Material glass(float roughness = 0.0f) {
  Material m;
  m.base_color = {1, 1, 1};
  m.roughness = roughness;
  m.transmission = 1.0f;
  m.body = true;
  return m;
}

/// A body between two planes at z = +-half, all of whose triangles are seen from outside.
Mesh slab(float half, float size = 100.0f) {
  Mesh mesh = square(size), below = square(size);
  for (Triangle& t : below.triangles) std::swap(t[1], t[2]);
  for (Vec3& p : mesh.positions) p.z = half;
  append(mesh, below, {0, 0, -half}, 0);
  return mesh;
}

Image picture_of(const Mesh& mesh, const std::vector<Material>& materials,
                 const Environment& environment, const Settings& settings = small_picture(8, 512),
                 const Camera& camera = from_above(4.0f, 0.02f)) {
  return render(scene_of(mesh, materials, environment), camera, settings).image;
}

TEST(Layers, white_bodies_in_a_white_furnace_nearly_vanish) {
  for (const float roughness : {0.0f, 0.3f, 1.0f}) {
    for (const float ior : {1.0f, 1.33f, 2.4f}) {
      Material m = glass(roughness);
      m.ior = ior;
      Settings settings = small_picture(16, 256);
      settings.max_bounces = 300;
      const Image image =
          picture_of(shapes::sphere(4), {m}, constant(1), settings, from_above(4.0f, 0.45f));
      // Tables of a strong refraction lose half a percent a bounce, and there are many inside.
      EXPECT_NEAR(mean(image), 1.0, ior < 2 ? 0.03 : 0.08)
          << "roughness " << roughness << ", index " << ior;
      EXPECT_LT(mean(image), 1.01);
    }
  }
}

TEST(Layers, white_layers_in_a_white_furnace_vanish) {
  std::vector<Material> materials(5);
  materials[0].clearcoat = 1.0f, materials[0].clearcoat_roughness = 0.2f;
  materials[1].sheen_color = {1, 1, 1}, materials[1].sheen_roughness = 0.5f;
  materials[2].transmission = 1.0f, materials[2].roughness = 0.5f;
  materials[3].diffuse_transmission = 0.6f;
  materials[4].iridescence = 1.0f, materials[4].roughness = 0.3f;
  for (size_t k = 0; k < materials.size(); ++k) {
    materials[k].base_color = {1, 1, 1};
    Settings settings = small_picture(16, 256);
    settings.max_bounces = 300;
    const Image image = picture_of(shapes::sphere(4), {materials[k]}, constant(1), settings,
                                   from_above(4.0f, 0.45f));
    EXPECT_NEAR(mean(image), 1.0, 0.012) << k;
  }
}

TEST(Layers, a_body_takes_what_its_length_takes) {
  Material m = glass();
  m.attenuation_color = {0.5f, 0.5f, 0.5f};
  m.attenuation_distance = 1.0f;
  m.ior = 1.0f;
  EXPECT_NEAR(mean(picture_of(slab(1.0f), {m}, constant(1))), 0.25, 1e-4);
  EXPECT_NEAR(mean(picture_of(slab(0.25f), {m}, constant(1))), std::sqrt(0.5), 1e-4);
  // With an index, both faces send back a 25th, from the far one through the body twice.
  m.ior = 1.5f;
  const double through = 0.25, r = 0.04, t = 1 - r;
  const double out = t * t * through / (1 - r * r * through * through);
  const double back = r + t * t * r * through * through / (1 - r * r * through * through);
  EXPECT_NEAR(mean(picture_of(slab(1.0f), {m}, constant(1), small_picture(16, 1024))), out + back,
              0.01);
}

TEST(Layers, bodies_that_touch_take_what_both_take_whichever_comes_first) {
  std::vector<Material> materials(3, glass());
  materials[0] = lambert(1.0f);
  for (Material& m : materials) m.ior = 1.0f, m.attenuation_distance = 1.0f, m.specular = 0.0f;
  materials[1].attenuation_color = {0.5f, 0.5f, 0.5f};
  materials[2].attenuation_color = {0.8f, 0.8f, 0.8f};
  Settings settings = small_picture(8, 64);
  settings.max_bounces = 0;
  const Environment sun = lone_sun({0, 0, 1});
  const double bare = mean(picture_of(square(100), materials, sun, settings));
  for (const bool lower_first : {false, true}) {
    for (const uint32_t upper : {1u, 2u}) {  // above the camera
      Mesh mesh = square(100);
      if (lower_first) append(mesh, slab(0.5f), {0, 0, 5.5f}, 1);
      append(mesh, slab(0.5f), {0, 0, 6.5f}, upper);
      if (!lower_first) append(mesh, slab(0.5f), {0, 0, 5.5f}, 1);
      const double expected = 0.5 * materials[upper].attenuation_color.x;
      EXPECT_NEAR(mean(picture_of(mesh, materials, sun, settings)) / bare, expected, 0.005)
          << lower_first << upper;
    }
  }
}

TEST(Layers, what_stands_in_a_body_is_seen_through_it) {
  Material m = glass();
  m.attenuation_color = {0.5f, 0.5f, 0.5f};
  m.attenuation_distance = 1.0f;
  m.ior = 1.0f;
  Material lamp = emitter(3);
  Mesh mesh = slab(1.0f);
  append(mesh, square(50), {0, 0, 0}, 1);
  EXPECT_NEAR(mean(picture_of(mesh, {m, lamp}, constant(0))), 1.5, 1e-3);
}

TEST(Layers, a_thin_surface_tints_what_is_behind_it_and_bends_nothing) {
  Material pane = glass();
  pane.body = false;
  pane.base_color = {0.5f, 0.5f, 0.5f};
  Mesh mesh = square(100);
  append(mesh, square(0.02f), {0, 0, -1}, 1);
  Material lamp = emitter(1);
  Settings settings = small_picture(8, 1024);
  const Image image =
      picture_of(mesh, {pane, lamp}, constant(0), settings, from_above(1.0f, 0.01f));
  EXPECT_NEAR(mean(image), 0.5 * 0.96, 0.01);
}

TEST(Layers, light_reaches_through_thin_surfaces_in_their_colour) {
  Environment sun = lone_sun({0, 0, 1});
  Material pane = glass();
  pane.body = false;
  pane.base_color = {1.0f, 0.5f, 0.0f};
  pane.specular = 0.0f;
  Mesh mesh = square(100);
  append(mesh, square(100), {0, 0, 5}, 1);  // above the camera
  Settings settings = small_picture(8, 64);
  settings.max_bounces = 0;
  const Vec3 bare = picture_of(square(100), {lambert(1.0f)}, sun, settings).pixels[0];
  const Vec3 tinted = picture_of(mesh, {lambert(1.0f), pane}, sun, settings).pixels[0];
  EXPECT_GT(bare.x, 0.1f);
  EXPECT_NEAR(tinted.x, bare.x, 0.01f * bare.x);
  EXPECT_NEAR(tinted.y, bare.y * 0.5f, 0.01f * bare.y);
  EXPECT_NEAR(tinted.z, 0.0f, 1e-4f);
}

TEST(Layers, shadow_rays_change_the_noise_and_not_the_picture) {
  // Light from one side only, so that what goes where counts.
  Environment sky;
  sky.sun_radius = 0.5f;
  sky.up = {0, 0, 1};
  sky.sun_direction = {0.3f, 0.2f, 1};
  std::vector<Material> materials(4);
  materials[0].clearcoat = 1.0f, materials[0].clearcoat_roughness = 0.4f;
  materials[1] = glass(0.6f);
  materials[1].body = false;
  materials[2].diffuse_transmission = 0.8f;
  materials[3].sheen_color = {1, 0.5f, 0.5f}, materials[3].sheen_roughness = 0.5f;
  for (size_t k = 0; k < materials.size(); ++k) {
    for (const float z : {3.0f, -3.0f}) {
      Camera camera = from_above(z, 0.3f);
      camera.position.x = 1.0f;
      camera.up = {0, 1, 0};
      Settings settings = small_picture(8, 4096);
      const double with = mean(picture_of(square(1), {materials[k]}, sky, settings, camera));
      settings.shadow_samples = 0;
      const double without = mean(picture_of(square(1), {materials[k]}, sky, settings, camera));
      EXPECT_NEAR(with / without, 1.0, 0.03) << k << " from " << z;
    }
  }
}

TEST(Layers, lamps_in_a_body_light_what_else_is_in_it_as_far_as_it_lets_them) {
  std::vector<Material> materials = {glass(), lambert(0.8f), emitter(5)};
  materials[0].attenuation_color = {0.3f, 0.3f, 0.3f};
  materials[0].attenuation_distance = 1.0f;
  Mesh mesh = slab(1.0f);
  append(mesh, square(50), {0, 0, -0.5f}, 1);
  append(mesh, square(0.5f), {0.8f, 0, 0.5f}, 2);
  for (const float ior : {1.0f, 1.5f}) {
    materials[0].ior = ior;
    Settings settings = small_picture(8, 4096);
    const double with = mean(picture_of(mesh, materials, constant(0), settings));
    settings.shadow_samples = 0;
    const double without = mean(picture_of(mesh, materials, constant(0), settings));
    EXPECT_NEAR(with / without, 1.0, 0.03) << ior;
  }
}

TEST(Layers, what_is_unlit_shows_its_colour_in_any_light) {
  Material sign = lambert(0.3f);
  sign.unlit = true;
  for (const float light : {0.0f, 5.0f}) {
    const Image image = picture_of(square(100), {sign}, constant(light), small_picture(4, 4));
    EXPECT_NEAR(mean(image), 0.3, 1e-5);
  }
  // And what it shows lights other things.
  Mesh mesh = square(1);
  append(mesh, square(100), {0, 0, 1}, 1);
  Settings settings = small_picture(8, 1024);
  const Image image =
      picture_of(mesh, {lambert(1.0f), sign}, constant(0), settings, from_above(0.9f, 0.02f));
  EXPECT_NEAR(mean(image), 0.3, 0.01);
}

TEST(Layers, reflections_have_the_strength_that_index_and_colour_give) {
  const auto reflected = [](const auto& change) {
    Material m = lambert(0.0f);
    m.specular = 1.0f;
    m.roughness = 0.0f;
    change(m);
    return picture_of(square(100), {m}, constant(1)).pixels[0];
  };
  EXPECT_NEAR(reflected([](Material&) {}).x, 0.04f, 0.002f);
  EXPECT_NEAR(reflected([](Material& m) { m.ior = 2.0f; }).x, 1.0f / 9, 0.004f);
  EXPECT_NEAR(reflected([](Material& m) { m.ior = 0.0f; }).x, 1.0f, 0.01f);
  EXPECT_NEAR(reflected([](Material& m) { m.specular = 0.5f; }).x, 0.02f, 0.002f);
  const Vec3 tinted = reflected([](Material& m) { m.specular_color = {0, 1, 5}; });
  EXPECT_NEAR(tinted.x, 0.0f, 0.002f);
  EXPECT_NEAR(tinted.z, 0.2f, 0.005f);
  EXPECT_NEAR(reflected([](Material& m) { m.clearcoat = 1, m.specular = 0; }).x, 0.04f, 0.002f);
}

TEST(Layers, textures_use_the_texture_coordinates_that_they_name) {
  const std::vector<uint8_t> texels = {255, 0, 0, 255, 0, 255, 0, 255};
  TextureView texture{.texels = texels, .width = 2, .height = 1, .nearest = true};
  Mesh mesh = square(1);
  mesh.uvs.assign(4, {0.25f, 0.5f});
  mesh.extras = {{ExtraKind::kUvs, 2}};
  for (int i = 0; i < 4; ++i) mesh.extra_values.insert(mesh.extra_values.end(), {0.75f, 0.5f});
  Material m = lambert(1.0f);
  m.unlit = true;
  m.base_color_texture.texture = 0;
  const auto seen = [&] {
    const Scene scene = scene_of(mesh, {m}, constant(0), {texture});
    return render(scene, from_above(), small_picture(2, 1)).image.pixels[0];
  };
  EXPECT_EQ(seen(), (Vec3{1, 0, 0}));
  m.base_color_texture.uv_set = 2;
  EXPECT_EQ(seen(), (Vec3{0, 1, 0}));
}

TEST(Layers, normal_maps_lean_the_way_that_their_image_stands) {
  Environment sun = lone_sun({0.3f, 0.5f, 0.8f});
  // Leans to the image's right and, more, to its top: (0.3, 0.6, 0.74).
  const std::vector<uint8_t> leaning = {166, 204, 222, 255}, flat = {128, 128, 255, 255};
  const Vec3 sun_at = normalized(sun.sun_direction, {0, 0, 1});
  struct Placed {
    std::vector<Vec2> uvs;
    Vec3 right, top;  ///< of the image, in the world
    Vec2 scale{1, 1};
    float rotation = 0.0f;
  };
  const std::vector<Vec2> upright = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  const Placed all[] = {{upright, {1, 0, 0}, {0, 1, 0}},
                        {{{1, 1}, {0, 1}, {0, 0}, {1, 0}}, {-1, 0, 0}, {0, 1, 0}},
                        {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {1, 0, 0}, {0, -1, 0}},
                        {{{0, 0}, {0, 1}, {1, 1}, {1, 0}}, {0, 1, 0}, {-1, 0, 0}},
                        {upright, {1, 0, 0}, {0, -1, 0}, {1, -1}},
                        {upright, {0, -1, 0}, {1, 0, 0}, {1, 1}, std::numbers::pi_v<float> / 2}};
  for (size_t k = 0; k < std::size(all); ++k) {
    Mesh mesh = square(1);
    mesh.uvs = all[k].uvs;
    Material m = lambert(1.0f);
    m.normal_texture = {.texture = 0, .scale = all[k].scale, .rotation = all[k].rotation};
    const auto seen = [&](const std::vector<uint8_t>& texel) {
      const TextureView texture{.texels = texel, .width = 1, .height = 1};
      return mean(
          render(scene_of(mesh, {m}, sun, {texture}), from_above(), small_picture(4, 64)).image);
    };
    const Vec3 normal =
        normalized(all[k].right * 0.302f + all[k].top * 0.6f + Vec3{0, 0, 0.741f}, {0, 0, 1});
    const double expected = std::max(0.0f, dot(normal, sun_at)) / sun_at.z;
    EXPECT_NEAR(seen(leaning) / seen(flat), expected, 0.02) << k;
    m.normal_scale = 0.0f;
    EXPECT_NEAR(seen(leaning) / seen(flat), 1.0, 0.01) << k;
  }
}

TEST(Layers, the_same_bytes_for_any_threads) {
  std::vector<Material> materials(2);
  materials[0] = glass(0.1f);
  materials[1].clearcoat = 1.0f, materials[1].iridescence = 1.0f;
  Mesh mesh = shapes::sphere(3);
  append(mesh, square(10), {0, 0, -2}, 1);
  const Scene scene = scene_of(mesh, materials, Environment{});
  const auto bytes = [&](uint32_t threads) {
    return render(scene, from_above(6, 0.6f), small_picture(40, 8),
                  {.progress = {}, .threads = threads})
        .image.pixels;
  };
  EXPECT_EQ(bytes(1), bytes(4));
}

}  // namespace
}  // namespace umbel::trace
