// Flies round a field of instances, drawn headless, a picture a frame.
//   umbel_vulkan [FILE.umbel] [--frames N] [--out DIR] [--size W H] [--instances N] [--error
//   PIXELS]
//                [--budget MB] [--looks normals|clusters] [--no-mesh-shaders] [--no-occlusion]
//                [--validate]
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "png.hpp"
#include "renderer.hpp"
#include "scene.hpp"
#include "unavailable.hpp"

namespace {

struct Options {
  std::string file;
  std::string out = ".";
  uint32_t frames = 8, instances = 1000, budget_mb = 64;
  float error = 1;
  sample::RendererConfig renderer;
  sample::DeviceOptions device;
  bool occlusion = true;
  sample::FrameInput::Looks looks = sample::FrameInput::Looks::kNormals;
};

uint32_t number(const std::string& word) {
  size_t used = 0;
  const unsigned long value = std::stoul(word, &used);
  if (used != word.size() || value == 0 || value > 1u << 20) {
    throw std::invalid_argument("not a number from 1 to 1048576: " + word);
  }
  return static_cast<uint32_t>(value);
}

Options parse(int argc, char** argv) {
  Options options;
  int at = 1;
  const auto value = [&]() -> std::string {
    if (at + 1 >= argc) throw std::invalid_argument(std::string(argv[at]) + " needs a value");
    return argv[++at];
  };
  for (; at < argc; ++at) {
    const std::string word = argv[at];
    if (word == "--frames")
      options.frames = number(value());
    else if (word == "--out")
      options.out = value();
    else if (word == "--instances")
      options.instances = number(value());
    else if (word == "--budget")
      options.budget_mb = number(value());
    else if (word == "--error")
      options.error = std::stof(value());
    else if (word == "--size") {
      options.renderer.width = number(value());
      options.renderer.height = number(value());
    } else if (word == "--looks") {
      const std::string looks = value();
      if (looks == "clusters")
        options.looks = sample::FrameInput::Looks::kClusters;
      else if (looks != "normals")
        throw std::invalid_argument("no such looks: " + looks);
    } else if (word == "--no-mesh-shaders")
      options.device.mesh_shaders = false;
    else if (word == "--no-occlusion")
      options.occlusion = false;
    else if (word == "--validate")
      options.device.validation = true;
    else if (word.starts_with("--") || !options.file.empty()) {
      throw std::invalid_argument("no such option: " + word);
    } else
      options.file = word;
  }
  return options;
}

umbel::Camera camera_at(const umbel::Aabb& box, float turn, float field_size) {
  const float x = box.max.x - box.min.x, y = box.max.y - box.min.y, z = box.max.z - box.min.z;
  const float size = std::sqrt(x * x + y * y + z * z);
  const float away = 0.3f * field_size + size;
  umbel::Camera camera;
  camera.target = {0.5f * (box.min.x + box.max.x), 0.5f * (box.min.y + box.max.y),
                   0.5f * (box.min.z + box.max.z)};
  camera.position = {away * std::sin(turn), 0.9f * size, away * std::cos(turn)};
  return camera;
}

void run(const Options& options) {
  std::string file = options.file;
  std::filesystem::create_directories(options.out);
  if (file.empty()) {
    file = options.out + "/blob.umbel";
    sample::write_blob(file, 6);
  }
  const umbel::Asset asset{std::filesystem::path(file)};
  const umbel::Aabb box = asset.info().bounds;
  const float spacing = 1.2f * std::max(box.max.x - box.min.x, box.max.z - box.min.z);
  const float field_size = spacing * std::sqrt(static_cast<float>(options.instances));
  const sample::Device device(options.device);
  sample::RendererConfig config = options.renderer;
  config.budget_bytes = uint64_t{options.budget_mb} << 20;
  sample::Renderer renderer(device, asset, sample::field(options.instances, spacing), config);
  std::printf("%s, clusters drawn by %s\n", device.name().c_str(),
              renderer.mesh_shaders() ? "mesh shaders" : "a vertex shader");
  const auto start = std::chrono::steady_clock::now();
  for (uint32_t f = 0; f < options.frames; ++f) {
    sample::FrameInput input;
    input.camera = camera_at(box, 0.05f * static_cast<float>(f), field_size);
    input.pixel_error = options.error;
    input.looks = options.looks;
    input.occlusion = options.occlusion;
    input.near_plane = 0.001f * spacing;
    const double now =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const sample::FrameReport report = renderer.draw(input, now);
    const std::string name = options.out + "/frame_" + std::to_string(f) + ".png";
    sample::write_png(name, config.width, config.height, renderer.pixels());
    std::printf(
        "%s: %u clusters (%u late, %u hidden), error %.2f of what is allowed, %u views, %u of %u "
        "slots\n",
        name.c_str(), report.clusters, report.late, report.hidden,
        static_cast<double>(report.step.worst_error), report.views, report.used_slots,
        report.slots);
  }
  if (device.validation_messages() > 0) throw std::runtime_error("validation found faults.");
}

}  // namespace

int main(int argc, char** argv) try {
  run(parse(argc, argv));
  return EXIT_SUCCESS;
} catch (const sample::Unavailable& error) {
  std::fprintf(stderr, "umbel_vulkan: skipped: %s\n", error.what());
  return 77;
} catch (const std::exception& error) {
  std::fprintf(stderr, "umbel_vulkan: %s\n", error.what());
  return EXIT_FAILURE;
}
