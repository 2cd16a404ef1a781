#include <algorithm>
#include <cmath>
#include <vector>

#include "checks.hpp"
#include "png.hpp"
#include "scene.hpp"

namespace sample {

namespace {

constexpr uint32_t kCameras = 16;
constexpr uint32_t kInstances = 625;

// Low beside the field, so that most instances are behind others. Small steps, and a jump to the
// other side in every eighth.
FrameInput view(uint32_t k, float field_size) {
  FrameInput input;
  const float turn = 0.002f * static_cast<float>(k) + (k % 8 == 7 ? 2.5f : 0);
  const float away = 0.55f * field_size;
  input.camera.position = {away * std::sin(turn), 0.8f, away * std::cos(turn)};
  input.camera.target = {0, 0, 0};
  input.pixel_error = 2;
  input.near_plane = 0.01f;
  return input;
}

// Clusters of several frames.
struct Sums {
  uint64_t frames = 0, drawn = 0, late = 0, all = 0;
  void add(const FrameReport& report, uint32_t without) {
    ++frames;
    drawn += report.clusters;
    late += report.late;
    all += without;
  }
  std::string text() const {
    return std::to_string(drawn / frames) + " clusters drawn a frame, " +
           std::to_string(late / frames) + " of them in the second pass; " +
           std::to_string(all / frames) + " without occlusion";
  }
};

}  // namespace

void check_occlusion(const Device& device, const umbel::Asset& asset,
                     const std::filesystem::path& folder) {
  constexpr float kSpacing = 2.4f;
  const float field_size = kSpacing * std::sqrt(static_cast<float>(kInstances));
  // Odd sizes, so that levels of the pyramid have odd ones.
  Renderer renderer(device, asset, field(kInstances, kSpacing), {.width = 477, .height = 271});
  uint64_t different = 0;
  Sums steps, jumps;
  FrameInput before = view(kCameras - 1, field_size);
  for (uint32_t k = 0; k < kCameras; ++k) {
    FrameInput input = view(k, field_size);
    input.occlusion = false;
    if (!draw_whole(renderer, input)) return expect(false, "all pages arrive");
    const uint32_t all = renderer.draw(input, 100).clusters;
    const std::vector<uint8_t> without(renderer.pixels().begin(), renderer.pixels().end());
    renderer.draw(before, 100);  // whose depth the first pass trusts
    input.occlusion = true;
    const FrameReport report = renderer.draw(input, 100);
    (k % 8 == 7 || k % 8 == 0 ? jumps : steps).add(report, all);
    for (size_t p = 0; p < without.size(); p += 4) {
      different += !std::equal(&without[p], &without[p] + 4, &renderer.pixels()[p]);
    }
    before = input;
  }
  write_png(folder / "field.png", 477, 271, renderer.pixels());
  expect(different == 0, std::to_string(different) + " pixels differ with occlusion, " +
                             std::to_string(kCameras) + " cameras, " + std::to_string(kInstances) +
                             " instances");
  expect(2 * steps.drawn < steps.all && steps.late > 0, "small steps: " + steps.text());
  expect(jumps.drawn <= jumps.all, "jumps: " + jumps.text());
}

}  // namespace sample
