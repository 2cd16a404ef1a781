// Flies round a field of instances: in a window where there is a display, else a picture a frame.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "clock.hpp"
#include "controls.hpp"
#include "make_frames.hpp"
#include "options.hpp"
#include "png.hpp"
#include "scene.hpp"
#include "show_window.hpp"
#include "unavailable.hpp"

namespace {

constexpr uint32_t kFrames = 8;  // of pictures, unless said

umbel::Camera camera_at(const umbel::Aabb& box, float turn, float field_size) {
  const float size = sample::size_of(box);
  const float away = 0.3f * field_size + size;
  umbel::Camera camera;
  camera.target = {0.5f * (box.min.x + box.max.x), 0.5f * (box.min.y + box.max.y),
                   0.5f * (box.min.z + box.max.z)};
  camera.position = {away * std::sin(turn), 0.9f * size, away * std::cos(turn)};
  return camera;
}

void draw_pictures(const sample::Options& options, const sample::Field& field) {
  const sample::Device device(options.device);
  const std::unique_ptr<sample::FrameMaker> renderer =
      sample::make_frames(device, field, options, options.renderer);
  std::printf("%s, clusters %s\n", device.name().c_str(), renderer->method().c_str());
  const sample::Clock clock;
  const uint32_t frames = options.frames == 0 ? kFrames : options.frames;
  for (uint32_t f = 0; f < frames; ++f) {
    sample::FrameInput input = options.input;
    input.camera = camera_at(field.box, 0.05f * static_cast<float>(f), field.size());
    const sample::FrameReport report = renderer->draw(input, clock.seconds());
    const std::string name = options.out + "/frame_" + std::to_string(f) + ".png";
    sample::write_png(name, options.renderer.width, options.renderer.height, renderer->pixels());
    std::printf(
        "%s: %u clusters (%u late, %u hidden), error %.2f of what is allowed, %u views, %u of %u "
        "slots\n",
        name.c_str(), report.clusters, report.late, report.hidden,
        static_cast<double>(report.step.worst_error), report.views, report.used_slots,
        report.slots);
    if (options.trace) {
      std::printf("    %u structures built, %u kept, %.1f MB\n", report.built, report.kept,
                  static_cast<double>(report.structure_bytes) * 1e-6);
    }
  }
  if (device.validation_messages() > 0) throw std::runtime_error("validation found faults.");
}

void run(sample::Options options) {
  std::string file = options.file;
  std::filesystem::create_directories(options.out);
  if (file.empty()) {
    file = options.out + "/blob.umbel";
    sample::write_blob(file, 6);
  }
  const sample::Field field(file, options.instances);
  options.renderer.budget_bytes = uint64_t{options.budget_mb} << 20;
  options.input.near_plane = 0.001f * field.spacing;
  options.input.camera = camera_at(field.box, 0, field.size());
  if (!options.headless && sample::show_window(options, field)) return;
  draw_pictures(options, field);
}

}  // namespace

int main(int argc, char** argv) try {
  const sample::Options options = sample::parse_options(argc, argv);
  if (options.help) {
    std::printf("%s\n%s\n", sample::kUsage, sample::kControlsHelp);
  } else {
    run(options);
  }
  return EXIT_SUCCESS;
} catch (const sample::Unavailable& error) {
  std::fprintf(stderr, "umbel_vulkan: skipped: %s\n", error.what());
  return 77;
} catch (const std::exception& error) {
  std::fprintf(stderr, "umbel_vulkan: %s\n", error.what());
  return EXIT_FAILURE;
}
