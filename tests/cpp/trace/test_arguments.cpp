// What is refused, and that it is refused with a sentence that names it.
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "trace/scenes.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {
namespace {

using namespace testing;

void expect_refused(const std::function<void()>& call, const std::string& named) {
  try {
    call();
    ADD_FAILURE() << "not refused: " << named;
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(named), std::string::npos) << error.what();
  }
}

TEST(TraceArguments, materials_out_of_range_are_named) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto refused = [](const std::function<void(Material&)>& change, const std::string& named) {
    std::vector<Material> materials(2);
    change(materials[1]);
    expect_refused([&] { scene_of(square(1), materials, constant(1)); }, "materials[1]." + named);
  };
  refused([](Material& m) { m.base_color.y = 1.5f; }, "base_color");
  refused([&](Material& m) { m.base_color.z = nan; }, "base_color");
  refused([&](Material& m) { m.metallic = nan; }, "metallic");
  refused([](Material& m) { m.roughness = -0.1f; }, "roughness");
  refused([](Material& m) { m.alpha = 2.0f; }, "alpha");
  refused([](Material& m) { m.emission.x = -1.0f; }, "emission");
  refused([](Material& m) { m.emission.x = INFINITY; }, "emission");
  refused([](Material& m) { m.normal_texture.texture = 3; }, "normal_texture");
  refused([](Material& m) { m.normal_texture = {.texture = 0, .uv_set = 64}; }, "normal_texture");
  refused([](Material& m) { m.clearcoat_texture.texture = 3; }, "clearcoat_texture");
  refused([](Material& m) { m.ior = 0.5f; }, "ior");
  refused([](Material& m) { m.transmission = 1.5f; }, "transmission");
  refused([](Material& m) { m.attenuation_distance = 0.0f; }, "attenuation_distance");
  refused([&](Material& m) { m.attenuation_distance = nan; }, "attenuation_distance");
  refused([&](Material& m) { m.sheen_color.x = nan; }, "sheen_color");
  refused([](Material& m) { m.iridescence_ior = 0.0f; }, "iridescence_ior");
  refused([&](Material& m) { m.normal_scale = nan; }, "normal_scale");
}

TEST(TraceArguments, textures_may_be_moved_as_far_as_floats_reach) {
  const std::vector<uint8_t> texels(4);
  const TextureView texture{.texels = texels, .width = 1, .height = 1};
  std::vector<Material> materials(1);
  TextureUse& use = materials[0].base_color_texture;
  use.texture = 0;
  use.offset = {3e38f, 3e38f};
  EXPECT_NO_THROW(scene_of(square(1), materials, constant(1), {texture}));
  for (const float wrong : {std::numeric_limits<float>::infinity(), NAN}) {
    use.offset = {wrong, 0};
    expect_refused([&] { scene_of(square(1), materials, constant(1), {texture}); },
                   "materials[0].base_color_texture");
  }
}

TEST(TraceArguments, a_look_must_fit_its_mesh) {
  Mesh mesh = square(1);
  mesh.materials = {0, 2};
  expect_refused([&] { scene_of(mesh, {Material{}, Material{}}, constant(1)); }, "triangle 1");
  const std::vector<uint8_t> texels(15);
  const TextureView texture{.texels = texels, .width = 2, .height = 2};
  expect_refused([&] { scene_of(square(1), {}, constant(1), {texture}); }, "textures[0]");
  mesh.materials.clear();
  mesh.positions[2].x = std::numeric_limits<float>::quiet_NaN();
  expect_refused([&] { scene_of(mesh, {}, constant(1)); }, "vertex 2");
}

TEST(TraceArguments, environments_out_of_range_are_named) {
  const auto refused = [](const std::function<void(Environment&)>& change,
                          const std::string& named) {
    Environment environment;
    change(environment);
    expect_refused([&] { scene_of(square(1), {}, environment); }, "environment." + named);
  };
  refused([](Environment& e) { e.turbidity = 0.0f; }, "turbidity");
  refused([](Environment& e) { e.sun_radius = 0.0f; }, "sun_radius");
  refused([](Environment& e) { e.sun_strength = -1.0f; }, "sun_strength");
  refused([](Environment& e) { e.up = {0, 0, 0}; }, "up");
  refused([](Environment& e) { e.sun_direction = {0, NAN, 0}; }, "sun_direction");
  refused([](Environment& e) { e.ground_albedo = {2, 0, 0}; }, "ground_albedo");
}

TEST(TraceArguments, settings_and_cameras_out_of_range_are_refused) {
  const Scene scene = scene_of(square(1), {}, constant(1));
  const auto refused = [&](const std::function<void(Settings&, Camera&)>& change,
                           const std::string& named) {
    Settings settings = small_picture(4, 1);
    Camera camera = from_above();
    change(settings, camera);
    expect_refused([&] { render(scene, camera, settings); }, named);
  };
  refused([](Settings& s, Camera&) { s.width = 0; }, "0 x 4");
  refused([](Settings& s, Camera&) { s.height = 100000; }, "100000");
  refused([](Settings& s, Camera&) { s.width = s.height = 32768; }, "268435456");
  refused([](Settings& s, Camera&) { s.samples = 0; }, "samples");
  refused([](Settings& s, Camera&) { s.max_bounces = 5000; }, "max_bounces");
  refused([](Settings& s, Camera&) { s.shadow_samples = 3; }, "shadow_samples");
  refused([](Settings& s, Camera&) { s.clamp = -1.0f; }, "clamp");
  refused([](Settings& s, Camera&) { s.clamp = std::numeric_limits<float>::infinity(); },
          "clamp is inf");
  refused([](Settings&, Camera& c) { c.target = c.position; }, "target");
  refused([](Settings&, Camera& c) { c.fov_y = 4.0f; }, "field of view");
  refused([](Settings&, Camera& c) { c.position.x = NAN; }, "finite");
  refused([](Settings&, Camera& c) { c.lens_radius = -1.0f; }, "lens");
}

TEST(TraceArguments, another_size_or_hierarchy_is_refused) {
  Scene scene = scene_of(square(1), {}, constant(1));
  Film film;
  accumulate(scene, from_above(), small_picture(4, 1), film);
  expect_refused([&] { accumulate(scene, from_above(), small_picture(5, 1), film); }, "film");
  expect_refused(
      [&] {
        scene.replace_structure(
            std::make_unique<Bvh>(Bvh::build(shapes::sphere(1).view(), quick())));
      },
      "triangles");
}

TEST(TraceArguments, a_cancelled_film_is_as_before) {
  const Scene scene = scene_of(square(1), {}, constant(1));
  Film film;
  accumulate(scene, from_above(), small_picture(64, 1), film);
  const Film before = film;
  const BuildOptions stop{.progress = [](float, std::string_view) { return false; }, .threads = 1};
  EXPECT_THROW(accumulate(scene, from_above(), small_picture(64, 1), film, stop), Error);
  EXPECT_EQ(film.samples, before.samples);
  EXPECT_EQ(film.sums, before.sums);
}

TEST(TraceArguments, many_paths_of_few_pixels_are_cancelled_soon) {
  const Scene scene = scene_of(square(1), {}, constant(1));
  for (const uint32_t threads : {1u, 2u}) {
    std::vector<float> fractions;
    const BuildOptions options{.progress =
                                   [&](float fraction, std::string_view) {
                                     fractions.push_back(fraction);
                                     return fractions.size() < 3;
                                   },
                               .threads = threads};
    Film film;
    EXPECT_THROW(accumulate(scene, from_above(), small_picture(16, 1u << 20), film, options),
                 Error);
    ASSERT_EQ(fractions.size(), 3u);
    EXPECT_LT(fractions.back(), 0.01f);
  }
}

}  // namespace
}  // namespace umbel::trace
