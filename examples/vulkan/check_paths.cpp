#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "checks.hpp"
#include "renderer.hpp"
#include "scene.hpp"

namespace sample {

namespace {

constexpr uint32_t kInstances = 100;
constexpr float kSpacing = 2.4f;

std::vector<uint8_t> picture(const Device& device, const umbel::Asset& asset,
                             const RendererConfig& config) {
  Renderer renderer(device, asset, field(kInstances, kSpacing), config);
  FrameInput input;
  input.camera.position = {3, 4, 14};
  input.camera.target = {0, 0, 0};
  input.pixel_error = 0.5f;
  if (!draw_whole(renderer, input)) expect(false, "all pages arrive");
  return {renderer.pixels().begin(), renderer.pixels().end()};
}

struct Differences {
  size_t pixels = 0, by_more_than_one = 0;
};

Differences of_paths(const Device& device, const umbel::Asset& asset, RendererConfig config) {
  const std::vector<uint8_t> mesh = picture(device, asset, config);
  config.mesh_shaders = false;
  const std::vector<uint8_t> pulled = picture(device, asset, config);
  Differences out;
  for (size_t p = 0; p < mesh.size(); p += 4) {
    int most = 0;
    for (size_t k = 0; k < 3; ++k) most = std::max(most, std::abs(mesh[p + k] - pulled[p + k]));
    out.pixels += most > 0;
    out.by_more_than_one += most > 1;
  }
  return out;
}

}  // namespace

// Both give the device the same positions. From there to pixels a device may round each path in its
// own way, but not where half the picture's size is a power of two: then scaling is exact.
void check_paths(const Device& device, const umbel::Asset& asset) {
  if (!device.mesh_shaders()) {
    std::printf("skipped: the device has no mesh shaders to compare with vertex pulling.\n");
    return;
  }
  const Differences exact = of_paths(device, asset, {.width = 512, .height = 256});
  expect(exact.pixels == 0, std::to_string(exact.pixels) +
                                " pixels of 512 x 256 differ by mesh shaders and vertex pulling");
  const Differences rounded = of_paths(device, asset, {.width = 480, .height = 270});
  constexpr size_t kPixels = 480 * 270;
  expect(rounded.pixels < kPixels / 100 && rounded.by_more_than_one < kPixels / 10000,
         std::to_string(rounded.pixels) + " of 480 x 270, " +
             std::to_string(rounded.by_more_than_one) + " of them by more than 1 / 255");
}

}  // namespace sample
