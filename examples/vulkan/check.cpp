// The sample's tests: `umbel_vulkan_check FOLDER` leaves its pictures there. Exits with 77 where
// the machine lacks what it needs.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>
#include <umbel/trace.hpp>

#include "checks.hpp"
#include "png.hpp"
#include "projection.hpp"
#include "renderer.hpp"
#include "scene.hpp"
#include "traced_renderer.hpp"
#include "unavailable.hpp"

namespace {
int failures = 0;
}

void sample::expect(bool good, const std::string& what) {
  std::printf("%s: %s\n", good ? "ok" : "FAILED", what.c_str());
  if (!good) ++failures;
}

bool sample::draw_whole(FrameMaker& renderer, const FrameInput& input) {
  for (uint32_t f = 0; f < 500; ++f) {
    const FrameReport report = renderer.draw(input, 0.01 * f);
    if (report.views > 0 && report.step.caught_up && report.step.worst_error <= 1) {
      renderer.draw(input, 0.01 * f);
      return renderer.draw(input, 0.01 * f).used_slots > 0;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return false;
}

namespace {

using sample::expect;

constexpr umbel::Vec4 kRed{1, 0, 0, 1};

bool is_red(const uint8_t* pixel) { return pixel[0] == 255 && pixel[1] == 0 && pixel[2] == 0; }

umbel::Camera random_inside(std::mt19937& random) {
  std::uniform_real_distribution<float> any(-1, 1);
  umbel::Camera camera;
  camera.position = {0.3f * any(random), 0.3f * any(random), 0.3f * any(random)};
  camera.target = {any(random), any(random), any(random)};
  camera.fov_y = 1.2f;
  return camera;
}

// From inside a closed mesh there is no background to be seen, whatever is in memory.
void no_red_from_inside(const sample::Device& device, const umbel::Asset& asset, bool mesh_shaders,
                        const std::string& folder) {
  sample::RendererConfig config{.width = 320, .height = 240, .budget_bytes = uint64_t{2} << 20};
  config.mesh_shaders = mesh_shaders;
  sample::Renderer renderer(device, asset, sample::field(1, 1), config);
  std::mt19937 random(1);
  uint64_t red = 0;
  uint32_t least = UINT32_MAX, most = 0, missing = 0;
  for (uint32_t f = 0; f < 200; ++f) {
    sample::FrameInput input;
    input.camera = random_inside(random);
    input.near_plane = 1e-4f;
    input.background = kRed;
    input.looks = sample::FrameInput::Looks::kNormals;
    // Often one and the same error would always show what is in memory already.
    input.pixel_error = f % 3 == 0 ? 0.5f : f % 3 == 1 ? 4.0f : 32.0f;
    const sample::FrameReport report = renderer.draw(input, 0.02 * f);
    for (size_t p = 0; p < renderer.pixels().size(); p += 4) red += is_red(&renderer.pixels()[p]);
    least = std::min(least, report.clusters);
    most = std::max(most, report.clusters);
    missing += report.step.worst_error > 1.01f;
    if (f == 150) {
      sample::write_png(folder + "/inside.png", config.width, config.height, renderer.pixels());
    }
    if (report.used_slots > report.slots) expect(false, "pages fit their slots");
  }
  expect(red == 0, std::to_string(red) + " red pixels from 200 cameras inside, " +
                       (renderer.mesh_shaders() ? "mesh shaders, " : "vertex shader, ") +
                       std::to_string(least) + " to " + std::to_string(most) + " clusters, " +
                       std::to_string(missing) + " frames that lacked pages");
}

constexpr uint32_t kSide = 4;  // samples of a pixel, squared
constexpr uint32_t kWidth = 240, kHeight = 180;

// The picture, as large as the tracer's.
std::vector<umbel::Vec3> means(std::span<const uint8_t> pixels) {
  std::vector<umbel::Vec3> out(size_t{kWidth} * kHeight, {0, 0, 0});
  for (uint32_t y = 0; y < kHeight * kSide; ++y) {
    for (uint32_t x = 0; x < kWidth * kSide; ++x) {
      const uint8_t* from = &pixels[4 * (size_t{y} * kWidth * kSide + x)];
      umbel::Vec3& to = out[size_t{y / kSide} * kWidth + x / kSide];
      constexpr float kShare = 1.0f / (255 * kSide * kSide);
      to = {to.x + kShare * from[0], to.y + kShare * from[1], to.z + kShare * from[2]};
    }
  }
  return out;
}

// Umbel's tracer, given the cut of the same view, sees the same normals.
template <class Maker>
void agrees_with_the_tracer(const sample::Device& device, const umbel::Asset& asset,
                            const std::string& picture) {
  const sample::RendererConfig config{.width = kWidth * kSide, .height = kHeight * kSide};
  Maker renderer(device, asset, sample::field(1, 1), config);
  sample::FrameInput input;
  input.camera.position = {1.2f, 1.0f, 2.6f};
  input.pixel_error = 2;
  input.background = {0.5f, 0.5f, 0.5f, 1};
  if (!sample::draw_whole(renderer, input)) return expect(false, "all pages arrive");
  sample::write_png(picture, config.width, config.height, renderer.pixels());

  const umbel::lod::View view = umbel::lod::view_camera(input.camera.position, input.camera.fov_y,
                                                        config.height, input.pixel_error);
  umbel::Mesh mesh = umbel::mesh_of_clusters(asset, umbel::clusters_of_cut(asset, view));
  mesh.normals.clear();
  const umbel::trace::Scene scene = umbel::trace::Scene::build(mesh.view());
  const umbel::trace::Settings settings{.width = kWidth, .height = kHeight, .samples = 256};
  const umbel::trace::Image normals = umbel::trace::features(scene, input.camera, settings).normal;

  const std::vector<umbel::Vec3> drawn = means(renderer.pixels());
  double sum = 0;
  for (size_t p = 0; p < drawn.size(); ++p) {
    const umbel::Vec3& n = normals.pixels[p];
    const umbel::Vec3 off =
        sample::minus(drawn[p], {0.5f + 0.5f * n.x, 0.5f + 0.5f * n.y, 0.5f + 0.5f * n.z});
    sum += static_cast<double>(sample::dot(off, off));
  }
  const double psnr = -10 * std::log10(sum / (3.0 * static_cast<double>(drawn.size())));
  char text[128];
  std::snprintf(text, sizeof text, "%s: %.1f dB to Umbel's tracer on the same cut, at least 35",
                renderer.method().c_str(), psnr);
  expect(psnr >= 35, text);
}

}  // namespace

int main(int argc, char** argv) try {
  const std::string folder = argc > 1 ? argv[1] : ".";
  std::filesystem::create_directories(folder);
  const sample::Device device({.validation = true});
  std::printf("%s\n", device.name().c_str());
  sample::write_blob(folder + "/blob.umbel", 6);
  const umbel::Asset asset{std::filesystem::path(folder + "/blob.umbel")};
  no_red_from_inside(device, asset, true, folder);
  no_red_from_inside(device, asset, false, folder);
  agrees_with_the_tracer<sample::Renderer>(device, asset, folder + "/normals.png");
  sample::check_paths(device, asset);
  sample::check_occlusion(device, asset, folder);
  if (device.ray_tracing()) {
    agrees_with_the_tracer<sample::TracedRenderer>(device, asset, folder + "/traced_normals.png");
    sample::check_traced(device, asset, folder);
    sample::check_deform(device);
  } else {
    std::printf("skipped: nothing is traced: the device has no ray tracing pipeline.\n");
  }
  sample::check_controls();
  expect(device.validation_messages() == 0, "the validation layers found nothing");
  return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
} catch (const sample::Unavailable& error) {
  std::printf("skipped: %s\n", error.what());
  return 77;
} catch (const std::exception& error) {
  std::fprintf(stderr, "umbel_vulkan_check: %s\n", error.what());
  return EXIT_FAILURE;
}
