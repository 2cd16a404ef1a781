// Pictures that are known exactly, or to be equal to each other.
#include <gtest/gtest.h>

#include <ctime>
#include <numbers>

#include "trace/scenes.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {
namespace {

using namespace testing;

/// The share of a cosine-weighted hemisphere that a square of half side a at height h covers, from
/// the point below its middle: the form factor of four right-angled corners.
double square_form_factor(double a, double h) {
  const double x = a / h, r = std::sqrt(1 + x * x);
  return 4.0 / (2 * std::numbers::pi) * (x / r * std::atan(x / r) * 2);
}

TEST(Render, a_white_furnace_stays_white) {
  // Nothing that is white may be seen in a white environment, whatever its shape and gloss.
  for (const float metallic : {0.0f, 1.0f}) {
    for (const float roughness : {0.05f, 0.4f, 1.0f}) {
      SCOPED_TRACE(::testing::Message() << "metallic " << metallic << " roughness " << roughness);
      Material white;
      white.base_color = {1, 1, 1};
      white.metallic = metallic;
      white.roughness = roughness;
      const Scene scene = scene_of(shapes::sphere(4), {white}, constant(1));
      Camera camera = from_above(4.0f, 0.45f);
      const Picture picture = render(scene, camera, small_picture(24, 256));
      EXPECT_NEAR(mean(picture.image), 1.0, 0.006);
      for (const Vec3& p : picture.image.pixels) EXPECT_NEAR(p.y, 1.0, 0.12);
    }
  }
}

TEST(Render, a_white_lambert_blob_in_a_white_furnace_stays_white) {
  // Concave, so that paths bounce often.
  const Scene scene = scene_of(shapes::blob(4, 3), {lambert(1.0f)}, constant(1));
  Settings settings = small_picture(24, 256);
  settings.max_bounces = 200;
  const Picture picture = render(scene, from_above(4.0f, 0.45f), settings);
  EXPECT_NEAR(mean(picture.image), 1.0, 0.005);
}

TEST(Render, no_material_sends_out_more_than_it_gets) {
  for (const float metallic : {0.0f, 0.5f, 1.0f}) {
    for (const float roughness : {0.0f, 0.3f, 0.7f}) {
      for (const float specular : {0.0f, 1.0f}) {
        Material m;
        m.base_color = {1.0f, 0.5f, 0.1f};
        m.metallic = metallic, m.roughness = roughness, m.specular = specular;
        const Scene scene = scene_of(square(100), {m}, constant(1));
        Camera grazing;
        grazing.position = {0, -2, 0.5f};
        grazing.fov_y = 0.05f;
        for (const Camera& camera : {from_above(), grazing}) {
          const Picture picture = render(scene, camera, small_picture(4, 1024));
          EXPECT_LT(mean(picture.image), 1.01);
          EXPECT_GT(mean(picture.image), 0.1);
        }
      }
    }
  }
}

TEST(Render, white_surfaces_stay_white_at_grazing_angles) {
  for (const float degrees : {0.2f, 0.5f, 1.0f, 2.0f}) {
    for (const float roughness : {0.0f, 0.1f, 0.3f, 1.0f}) {
      SCOPED_TRACE(::testing::Message() << degrees << " degrees, roughness " << roughness);
      Material white;
      white.base_color = {1, 1, 1};
      white.roughness = roughness;
      const Scene scene = scene_of(square(1000), {white}, constant(1));
      const float angle = degrees * std::numbers::pi_v<float> / 180;
      Camera grazing;
      grazing.position = {0, -50 * std::cos(angle), 50 * std::sin(angle)};
      grazing.fov_y = 1e-5f;
      EXPECT_NEAR(mean(render(scene, grazing, small_picture(4, 1024)).image), 1.0, 0.02);
    }
  }
}

TEST(Render, vertex_colours_out_of_range_make_and_swallow_no_light) {
  Mesh mesh = square(100);
  const auto radiance = [&](const Vec4& color) {
    mesh.colors.assign(4, color);
    const Scene scene = scene_of(mesh, {lambert(1.0f)}, constant(1));
    return render(scene, from_above(), small_picture(1, 256)).image.pixels[0];
  };
  const Vec3 found = radiance({3, 0.5f, -2, 1});
  EXPECT_EQ(found, radiance({1, 0.5f, 0, 1}));
  EXPECT_NEAR(found.x, 1, 0.01);
}

TEST(Render, a_plane_under_an_even_sky_has_the_radiance_of_its_albedo) {
  const Scene scene = scene_of(square(100), {lambert(0.5f)}, constant(2));
  EXPECT_NEAR(mean(render(scene, from_above(), small_picture(8, 512)).image), 1.0, 0.005);
}

TEST(Render, a_plane_under_a_square_light_has_the_radiance_of_its_form_factor) {
  Material light = emitter(5);
  Mesh mesh = square(100);
  append(mesh, square(0.5f), {0, 0, 1}, 1);
  const Scene scene = scene_of(mesh, {lambert(0.6f), light}, constant(0));
  EXPECT_EQ(scene.light_count(), 2u);
  const double expected = 0.6 * 5 * square_form_factor(0.5, 1);
  Camera below = from_above(0.9f, 0.02f);
  for (const uint32_t shadow_samples : {0u, 1u, 2u}) {
    SCOPED_TRACE(shadow_samples);
    Settings settings = small_picture(8, 1024);
    settings.shadow_samples = shadow_samples;
    EXPECT_NEAR(mean(render(scene, below, settings).image) / expected, 1.0, 0.02);
  }
}

TEST(Render, a_lamp_lights_as_much_as_its_alpha_shows_of_it) {
  Mesh mesh = square(100);
  append(mesh, square(0.5f), {0, 0, 1}, 1);
  const double whole = 0.6 * 5 * square_form_factor(0.5, 1);
  Material light = emitter(5);
  light.alpha = 0.25f;
  for (const AlphaMode mode : {AlphaMode::kBlend, AlphaMode::kMask}) {
    light.alpha_mode = mode;
    const double expected = mode == AlphaMode::kBlend ? 0.25 * whole : 0.0;
    const Scene scene = scene_of(mesh, {lambert(0.6f), light}, constant(0));
    for (const uint32_t shadow_samples : {0u, 1u, 2u}) {
      SCOPED_TRACE(shadow_samples);
      Settings settings = small_picture(8, 1024);
      settings.shadow_samples = shadow_samples;
      EXPECT_NEAR(mean(render(scene, from_above(0.9f, 0.02f), settings).image), expected,
                  0.02 * whole);
    }
  }
}

TEST(Render, the_sun_lights_a_plane_by_the_cosine_of_its_angle) {
  Environment environment = lone_sun({0, 0, 1});
  const auto radiance = [&](float albedo) {
    const Scene scene = scene_of(square(100), {lambert(albedo)}, environment);
    return mean(render(scene, from_above(), small_picture(8, 64)).image);
  };
  const double overhead = radiance(0.8f);
  EXPECT_GT(overhead, 0.3);
  EXPECT_NEAR(radiance(0.4f), overhead / 2, 1e-3);
  // The plane turned against the sun, and not the sun in its atmosphere.
  Mesh tilted = square(100);
  for (Vec3& p : tilted.positions) p = {p.x, p.y * 0.5f, p.y * std::sqrt(0.75f)};
  const Scene scene = scene_of(tilted, {lambert(0.8f)}, environment);
  EXPECT_NEAR(mean(render(scene, from_above(), small_picture(8, 64)).image), overhead / 2,
              overhead * 0.01);
}

TEST(Render, shadow_rays_change_the_noise_and_not_the_picture) {
  // Sun, sky and a light, on a rough metal: everything that is weighted.
  Material metal;
  metal.base_color = {0.9f, 0.6f, 0.4f};
  metal.metallic = 1.0f;
  metal.roughness = 0.4f;
  Material light = emitter(3, 0.3f);
  Mesh mesh = square(2);
  append(mesh, shapes::sphere(3), {0, 0, 1}, 1);
  append(mesh, square(0.7f), {1.5f, 0, 2}, 2);
  Environment environment;
  environment.up = {0, 0, 1};
  environment.sun_radius = 0.3f;  // large enough to be found by bounces alone
  const Scene scene = scene_of(mesh, {lambert(0.5f), metal, light}, environment);
  Camera camera;
  camera.position = {-3, -6, 4};
  camera.target = {0, 0, 0.7f};
  camera.up = {0, 0, 1};
  double means[3];
  for (const uint32_t n : {0u, 1u, 2u}) {
    Settings settings = small_picture(24, 1024);
    settings.shadow_samples = n;
    const Picture picture = render(scene, camera, settings);
    means[n] = mean(picture.image);
    EXPECT_EQ(picture.statistics.shadow == 0, n == 0);
  }
  EXPECT_NEAR(means[0] / means[2], 1.0, 0.02);
  EXPECT_NEAR(means[1] / means[2], 1.0, 0.01);
}

TEST(Render, russian_roulette_changes_the_noise_and_not_the_picture) {
  // In a pit light comes by many bounces.
  Mesh mesh = square(1);
  for (const float side : {-1.0f, 1.0f}) {
    Mesh wall = square(1);
    for (Vec3& p : wall.positions) p = {side, p.x, p.y + 1};
    append(mesh, wall, {0, 0, 0}, 0);
    for (Vec3& p : wall.positions) p = {p.y, side, p.z};
    append(mesh, wall, {0, 0, 0}, 0);
  }
  const Scene scene = scene_of(mesh, {lambert(0.9f)}, constant(1));
  Settings settings = small_picture(16, 1024);
  settings.max_bounces = 300;
  const Picture ended = render(scene, from_above(1.0f, 1.0f), settings);
  settings.roulette_from = 60;
  const Picture long_paths = render(scene, from_above(1.0f, 1.0f), settings);
  EXPECT_GT(long_paths.statistics.bounce, ended.statistics.bounce * 5 / 4);
  EXPECT_LT(mean(long_paths.image), 0.97);
  EXPECT_NEAR(mean(ended.image) / mean(long_paths.image), 1.0, 0.005);
}

TEST(Render, errors_fall_with_the_root_of_the_samples_or_faster) {
  Material light = emitter(5);
  Mesh mesh = square(100);
  append(mesh, square(0.5f), {0, 0, 1}, 1);
  const Scene scene = scene_of(mesh, {lambert(0.6f), light}, constant(0));
  const double expected = 0.6 * 5 * square_form_factor(0.5, 1);
  const auto error = [&](uint32_t samples) {
    double sum = 0;
    const Image image = render(scene, from_above(0.9f, 1e-3f), small_picture(24, samples)).image;
    for (const Vec3& p : image.pixels) sum += (p.x / expected - 1) * (p.x / expected - 1);
    return std::sqrt(sum / static_cast<double>(image.pixels.size()));
  };
  const double few = error(16), many = error(256);
  EXPECT_GT(few, 0.0);
  EXPECT_LT(many, few / 4);
  EXPECT_LT(many, 0.01);
}

TEST(Render, what_is_half_transparent_passes_half_the_light) {
  Material veil = lambert(0.0f);
  veil.alpha = 0.5f;
  veil.alpha_mode = AlphaMode::kBlend;
  Mesh mesh = square(100);
  append(mesh, square(100), {0, 0, 0.5f}, 1);
  const Scene scene = scene_of(mesh, {lambert(1.0f), veil}, constant(1));
  Settings settings = small_picture(8, 1024);
  settings.max_bounces = 0;
  // Half the sky reaches the plane, and half of that the camera.
  const Picture picture = render(scene, from_above(), settings);
  EXPECT_NEAR(mean(picture.image), 0.25, 0.01);
  EXPECT_GT(picture.statistics.continued, 0u);
}

TEST(Render, a_thousand_veils_are_seen_through) {
  Material veil = lambert(0.0f);
  veil.alpha = 0.001f;
  veil.alpha_mode = AlphaMode::kBlend;
  Mesh mesh = square(100);
  for (uint32_t k = 1; k <= 1000; ++k)
    append(mesh, square(100), {0, 0, 0.0005f * static_cast<float>(k)}, 1);
  const Scene scene = scene_of(mesh, {emitter(1), veil}, constant(1));
  const double seen = std::pow(1.0 - 0.001, 1000);
  EXPECT_NEAR(mean(render(scene, from_above(), small_picture(4, 256)).image), seen, 0.03);
  // As far as light comes down.
  const Scene lit = scene_of(mesh, {lambert(1), veil}, constant(1));
  Settings settings = small_picture(4, 256);
  settings.max_bounces = 0;
  EXPECT_GT(mean(render(lit, from_above(), settings).image), 0.5 * seen * seen);
}

TEST(Render, nothing_in_the_plane_of_a_wall_is_no_hole_in_it) {
  Material nothing = lambert(0.0f);
  nothing.alpha = 0.0f;
  nothing.alpha_mode = AlphaMode::kMask;
  Camera askew;
  askew.position = {0.3f, 0.2f, 6};
  askew.fov_y = 0.5f;
  for (const float height : {0.0f, 0.3f}) {
    Mesh mesh;
    append(mesh, square(2), {0.37f, 0, height}, 1);
    append(mesh, square(5), {0, 0, height}, 0);
    const Scene scene = scene_of(mesh, {emitter(1), nothing}, constant(0));
    for (const Vec3& p : render(scene, askew, small_picture(16, 16)).image.pixels)
      EXPECT_EQ(p.x, 1.0f);
  }
}

TEST(Render, every_veil_in_one_plane_counts) {
  Material veil = lambert(0.0f), nothing = veil;
  veil.alpha = 0.5f;
  veil.alpha_mode = AlphaMode::kBlend;
  nothing.alpha = 0.0f;
  nothing.alpha_mode = AlphaMode::kMask;
  for (const uint32_t veils : {1u, 2u, 3u}) {
    Mesh mesh;
    append(mesh, square(10), {0, 0, 0.5f}, 2);
    for (uint32_t k = 0; k < veils; ++k) append(mesh, square(10), {0, 0, 0.5f}, 1);
    append(mesh, square(100), {0, 0, 0}, 0);
    const double seen = std::pow(0.5, veils);
    Settings settings = small_picture(8, 1024);
    settings.max_bounces = 0;
    const std::vector<Material> lamp = {emitter(1), veil, nothing},
                                lit = {lambert(1), veil, nothing};
    const double of_lamp =
        mean(render(scene_of(mesh, lamp, constant(0)), from_above(), settings).image);
    EXPECT_NEAR(of_lamp / seen, 1, 0.03) << veils;
    const double of_sun =
        mean(render(scene_of(mesh, lit, lone_sun({0, 0, 1})), from_above(), settings).image);
    const double alone = mean(
        render(scene_of(square(100), {lambert(1)}, lone_sun({0, 0, 1})), from_above(), settings)
            .image);
    EXPECT_NEAR(of_sun / alone / (seen * seen), 1, 0.06) << veils;
  }
}

TEST(Render, a_thousand_veils_in_one_plane_are_seen_through) {
  Material veil = lambert(0.0f);
  veil.alpha = 0.001f;
  veil.alpha_mode = AlphaMode::kBlend;
  Mesh mesh = square(100);
  for (uint32_t k = 0; k < 1000; ++k) append(mesh, square(100), {0, 0, 0.5f}, 1);
  const std::vector<Material> materials = {emitter(1), veil};
  const Scene scene = scene_of(mesh, materials, constant(1));
  const Camera camera = from_above(1.0f, 0.05f);
  const Settings settings = small_picture(4, 64);
  const std::clock_t began = std::clock();
  const Picture picture = render(scene, camera, settings);
  EXPECT_LT(double(std::clock() - began) / CLOCKS_PER_SEC, 20);
  EXPECT_NEAR(mean(picture.image), std::pow(1.0 - 0.001, 1000), 0.05);
}

TEST(Render, holes_of_a_cut_out_texture_are_not_there) {
  // Left half of the image opaque, right half a hole.
  const std::vector<uint8_t> texels = {0, 0, 0, 255, 255, 255, 255, 0};
  TextureView texture{.texels = texels, .width = 2, .height = 1, .srgb = true, .nearest = true};
  Material leaf = lambert(1.0f);
  leaf.alpha_mode = AlphaMode::kMask;
  leaf.base_color_texture.texture = 0;
  Mesh mesh = square(1);
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  const Scene scene = scene_of(mesh, {leaf}, constant(1), {texture});
  const Picture picture = render(scene, from_above(10, 0.15f), small_picture(16, 16));
  for (uint32_t y = 0; y < 16; ++y) {
    for (uint32_t x = 0; x < 16; ++x) {
      const float value = picture.image.pixels[y * 16 + x].x;
      if (x < 6) EXPECT_NEAR(value, 0.0f, 1e-6f);
      if (x > 9) EXPECT_NEAR(value, 1.0f, 1e-6f);
    }
  }
}

TEST(Render, a_texture_colors_what_its_uvs_say) {
  // Red, green / blue, white, from the top left.
  const std::vector<uint8_t> texels = {255, 0, 0,   255, 0,   255, 0,   255,
                                       0,   0, 255, 255, 255, 255, 255, 255};
  TextureView texture{.texels = texels, .width = 2, .height = 2, .srgb = true, .nearest = true};
  Material painted = lambert(1.0f);
  painted.base_color_texture.texture = 0;
  Mesh mesh = square(1);
  mesh.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};  // v runs down
  const auto corner = [&](const Material& m, uint32_t x, uint32_t y) {
    const Scene scene = scene_of(mesh, {m}, constant(1), {texture});
    const Picture p = render(scene, from_above(10, 0.15f), small_picture(16, 32));
    return p.image.pixels[y * 16 + x];
  };
  EXPECT_GT(corner(painted, 3, 3).x, 0.9f);
  EXPECT_LT(corner(painted, 3, 3).y, 0.1f);
  EXPECT_GT(corner(painted, 12, 3).y, 0.9f);
  EXPECT_LT(corner(painted, 12, 3).x, 0.1f);
  EXPECT_GT(corner(painted, 3, 12).z, 0.9f);
  EXPECT_GT(corner(painted, 12, 12).x, 0.9f);
  Material moved = painted;
  moved.base_color_texture.offset = {0.5f, 0.0f};  // what was right is left
  EXPECT_GT(corner(moved, 3, 3).y, 0.9f);
  EXPECT_LT(corner(moved, 3, 3).x, 0.1f);
}

TEST(Render, the_same_bytes_for_any_threads_and_any_passes) {
  Material glossy;
  glossy.roughness = 0.2f;
  const Scene scene = scene_of(shapes::blob(4, 1), {glossy}, Environment{});
  const Settings settings = small_picture(40, 16);
  const Camera camera = auto_camera(scene, 40, 40);
  const Image one = render(scene, camera, settings, {.progress = {}, .threads = 1}).image;
  for (const uint32_t threads : {2u, 3u, 0u})
    EXPECT_EQ(render(scene, camera, settings, {.progress = {}, .threads = threads}).image.pixels,
              one.pixels);
  Film film;
  for (const uint32_t samples : {1u, 4u, 11u}) {
    Settings part = settings;
    part.samples = samples;
    accumulate(scene, camera, part, film);
  }
  EXPECT_EQ(film.image().pixels, one.pixels);
  Settings other = settings;
  other.seed = 2;
  EXPECT_NE(render(scene, camera, other).image.pixels, one.pixels);
}

TEST(Render, sums_of_many_samples_lose_no_light) {
  const Scene scene = scene_of({}, {}, constant(0.1f));
  const uint32_t samples = 1u << 21;
  const Settings settings = small_picture(1, samples);
  EXPECT_EQ(render(scene, from_above(), settings).image.pixels[0].x, 0.1f);
  EXPECT_EQ(features(scene, from_above(), settings).albedo.pixels[0].x, 0.1f);
}

TEST(Render, every_builder_gives_the_same_picture) {
  const Mesh mesh = shapes::blob(4, 2);
  Scene scene = scene_of(mesh, {lambert(0.7f)}, Environment{});
  const Camera camera = auto_camera(scene, 32, 32);
  const Image expected = render(scene, camera, small_picture(32, 8)).image;
  for (const bvh::Builder builder : {bvh::Builder::kSweep, bvh::Builder::kLbvh}) {
    BvhConfig config;
    config.tree = {};
    config.tree.builder = builder;
    config.width = 4;
    scene.replace_structure(std::make_unique<Bvh>(Bvh::build(mesh.view(), config)));
    EXPECT_EQ(render(scene, camera, small_picture(32, 8)).image.pixels, expected.pixels);
  }
}

TEST(Render, rays_are_counted) {
  const Scene scene = scene_of(square(100), {lambert(0.5f)}, constant(1));
  Settings settings = small_picture(8, 16);
  settings.max_bounces = 0;
  const Statistics s = render(scene, from_above(), settings).statistics;
  EXPECT_EQ(s.primary, 8u * 8 * 16);
  EXPECT_EQ(s.bounce, s.primary);  // one more, which only finds light
  EXPECT_LE(s.shadow, 2 * s.primary);
  EXPECT_GT(s.shadow, s.primary / 2);
  EXPECT_EQ(s.rays(), s.primary + s.bounce + s.shadow);
  EXPECT_GT(s.seconds, 0.0);
}

TEST(Render, no_mesh_gives_a_picture_of_the_sky) {
  const Scene scene = scene_of({}, {}, constant(0.25f));
  EXPECT_NEAR(mean(render(scene, from_above(), small_picture(8, 1)).image), 0.25, 1e-6);
  EXPECT_GT(mean(render(Scene{}, from_above(), small_picture(8, 1)).image), 0.0);
}

TEST(Render, extreme_and_degenerate_geometry_gives_numbers) {
  Mesh flat = square(1);
  flat.triangles.push_back({0, 0, 1});
  flat.normals.assign(4, Vec3{0, 0, 0});
  Mesh tiny = shapes::blob(3, 1), huge = tiny, far = tiny;
  for (Vec3& p : tiny.positions) p = {p.x * 1e-14f, p.y * 1e-14f, p.z * 1e-14f};
  for (Vec3& p : huge.positions) p = {p.x * 1e14f, p.y * 1e14f, p.z * 1e14f};
  for (Vec3& p : far.positions) p = {p.x + 1e6f, p.y + 1e6f, p.z};
  Material glowing;
  glowing.emission = {1, 2, 3};
  glowing.roughness = 0.0f;
  for (const Mesh& mesh : {flat, tiny, huge, far, shapes::soup(500, 1)}) {
    const Scene scene = scene_of(mesh, {glowing}, Environment{});
    const Camera camera = auto_camera(scene, 24, 24);
    const Picture picture = render(scene, camera, small_picture(24, 4));
    EXPECT_TRUE(all_finite(picture.image));
    EXPECT_GT(mean(picture.image), 0.0);
  }
}

TEST(Render, small_and_large_copies_of_a_mesh_look_the_same) {
  const Mesh mesh = shapes::blob(4, 5);
  const auto picture = [&](float scale) {
    Mesh scaled = mesh;
    for (Vec3& p : scaled.positions) p = {p.x * scale, p.y * scale, p.z * scale};
    const Scene scene = scene_of(scaled, {lambert(0.8f)}, Environment{});
    return mean(render(scene, auto_camera(scene, 32, 32), small_picture(32, 64)).image);
  };
  const double expected = picture(1.0f);
  for (const float scale : {1e-12f, 1e-3f, 1e3f, 1e12f})
    EXPECT_NEAR(picture(scale) / expected, 1.0, 0.01) << scale;
}

TEST(Render, lamps_of_any_size_give_the_same_light) {
  const auto picture = [](float scale, uint32_t shadow_samples) {
    Mesh mesh = square(100);
    append(mesh, square(0.5f), {0, 0, 1}, 1);
    for (Vec3& p : mesh.positions) p = {p.x * scale, p.y * scale, p.z * scale};
    const Scene scene = scene_of(mesh, {lambert(0.6f), emitter(5)}, Environment{});
    Settings settings = small_picture(8, 64);
    settings.shadow_samples = shadow_samples;
    return mean(render(scene, from_above(0.9f * scale, 1e-3f), settings).image);
  };
  for (const uint32_t shadow_samples : {1u, 2u}) {
    const double expected = picture(1.0f, shadow_samples);
    for (const float scale : {0x1p-110f, 0x1p-80f, 0x1p80f})
      EXPECT_NEAR(picture(scale, shadow_samples) / expected, 1.0, 0.02) << scale;
  }
}

}  // namespace
}  // namespace umbel::trace
