#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

#include "checks.hpp"
#include "png.hpp"
#include "renderer.hpp"
#include "scene.hpp"
#include "traced_renderer.hpp"

namespace sample {

namespace {

constexpr uint32_t kInstances = 100, kSteps = 16;
constexpr float kSpacing = 2.4f;

FrameInput over_field(uint32_t step) {
  FrameInput input;
  const float turn = 0.01f * static_cast<float>(step);
  input.camera.position = {14 * std::sin(turn), 4, 14 * std::cos(turn)};
  input.camera.target = {0, 0, 0};
  input.pixel_error = 0.5f;
  return input;
}

// The share of pixels of two pictures that differ by more than rounding.
double differing(std::span<const uint8_t> a, std::span<const uint8_t> b) {
  size_t pixels = 0;
  for (size_t p = 0; p < a.size(); p += 4) {
    int most = 0;
    for (size_t k = 0; k < 3; ++k) most = std::max(most, std::abs(a[p + k] - b[p + k]));
    pixels += most > 3;
  }
  return 4.0 * static_cast<double>(pixels) / static_cast<double>(a.size());
}

// Rays and rasterisation cover the same pixels, but for those at edges.
void same_as_drawn(const Device& device, const umbel::Asset& asset, TracedRenderer& traced,
                   const RendererConfig& config) {
  Renderer drawn(device, asset, field(kInstances, kSpacing), config);
  for (const auto looks : {FrameInput::Looks::kNormals, FrameInput::Looks::kClusters}) {
    FrameInput input = over_field(0);
    input.looks = looks;
    if (!draw_whole(drawn, input) || !draw_whole(traced, input)) {
      return expect(false, "all pages arrive");
    }
    const double share = differing(drawn.pixels(), traced.pixels());
    expect(share < 0.02, "traced as drawn, but for " + std::to_string(100 * share) +
                             " % of the pixels (at most 2)");
  }
}

void built_where_the_cut_changed(TracedRenderer& traced) {
  traced.draw(over_field(0), 10);
  const FrameReport still = traced.draw(over_field(0), 10);
  expect(still.built == 0 && still.kept > 50, "a camera that stands still builds none of " +
                                                  std::to_string(still.kept) +
                                                  " bottom-level structures");
  uint64_t built = 0, kept = 0;
  for (uint32_t step = 1; step <= kSteps; ++step) {
    const FrameReport report = traced.draw(over_field(step), 10 + step);
    built += report.built;
    kept += report.kept;
  }
  expect(built > 0 && built < kept / 4, "small steps build " + std::to_string(built / kSteps) +
                                            " a frame, and keep " + std::to_string(kept / kSteps));
}

// From inside a closed mesh rays never get out, whatever is in memory.
void no_red_from_inside(const Device& device, const umbel::Asset& asset) {
  const RendererConfig config{.width = 160, .height = 120, .budget_bytes = uint64_t{2} << 20};
  TracedRenderer renderer(device, asset, field(1, 1), config);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> any(-1, 1);
  uint64_t red = 0;
  for (uint32_t f = 0; f < 50; ++f) {
    FrameInput input;
    input.camera.position = {0.3f * any(random), 0.3f * any(random), 0.3f * any(random)};
    input.camera.target = {any(random), any(random), any(random)};
    input.background = {1, 0, 0, 1};
    input.pixel_error = f % 2 == 0 ? 0.5f : 16.0f;
    const FrameReport report = renderer.draw(input, 0.02 * f);
    if (report.used_slots > report.slots) expect(false, "pages fit their slots");
    const std::span<const uint8_t> pixels = renderer.pixels();
    for (size_t p = 0; p < pixels.size(); p += 4) red += pixels[p] == 255 && pixels[p + 1] == 0;
  }
  expect(red == 0, std::to_string(red) + " red pixels from 50 cameras inside, traced");
}

}  // namespace

void check_traced(const Device& device, const umbel::Asset& asset,
                  const std::filesystem::path& folder) {
  const RendererConfig config{.width = 480, .height = 270};
  TracedRenderer traced(device, asset, field(kInstances, kSpacing), config);
  same_as_drawn(device, asset, traced, config);
  built_where_the_cut_changed(traced);
  FrameInput shaded = over_field(0);
  shaded.looks = FrameInput::Looks::kShaded;
  const FrameReport report = traced.draw(shaded, 100);
  std::printf("    %.1f MB of structures\n", static_cast<double>(report.structure_bytes) * 1e-6);
  write_png((folder / "traced.png").string(), config.width, config.height, traced.pixels());
  no_red_from_inside(device, asset);
}

}  // namespace sample
