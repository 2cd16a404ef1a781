// What a step of a residency takes where very much is open.
//
//   stream_bench [--subdivisions N] [--groups-per-step N] [--seconds S]
//
// A blob of 20 * 4^N triangles (9: 5.2 million) is built into small groups, so that
// there are many of them. All of its pages are there. A camera circles it at 60 frames a
// second, once round in a minute, and looks ahead, 1080 pixels high; errors of 1, .3, .1 and .02
// pixels are asked for, without the frustum's planes and with them. Printed: groups that are open,
// clusters that are shown, and the processor time of a step: its mean, the 99th of 100, the worst;
// groups that a step evaluated, and the share of steps that had more to evaluate.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <numbers>
#include <vector>

#include "base/math.hpp"
#include "umbel/lod.hpp"
#include "umbel/stream.hpp"

namespace {

using umbel::Vec3;

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// As in `umbel bench stream`.
umbel::StreamView seen(const umbel::Asset& asset, int frame, float pixels, bool has_planes) {
  const umbel::Aabb& box = asset.info().bounds;
  const Vec3 middle = 0.5f * (box.min + box.max), whole = box.max - box.min;
  const float size = std::sqrt(umbel::dot(whole, whole));
  const float turn = 2 * std::numbers::pi_v<float> * static_cast<float>(frame) / 3600;
  const float distance = size * (0.6f + 0.15f * std::sin(5 * turn));
  const Vec3 out{std::cos(turn), 0.25f * std::sin(3 * turn), std::sin(turn)};
  const Vec3 ahead{-std::sin(turn), 0, std::cos(turn)};
  const umbel::Camera camera{
      middle + distance * out, middle + 0.15f * size * ahead, {0, 1, 0}, 1.0f};
  umbel::StreamView view{
      0, umbel::lod::view_camera(camera.position, camera.fov_y, 1080, pixels), {}};
  if (has_planes) view.planes = umbel::lod::frustum_planes(camera, 16.0f / 9);
  return view;
}

void measure(const umbel::Asset& asset, umbel::ResidencyConfig config, float pixels,
             bool has_planes, int frames) {
  const auto clock = std::make_shared<double>(0);
  umbel::Residency residency(asset, config, umbel::make_model_loader(asset, {0, 1e18}, clock));
  umbel::StreamView view[] = {seen(asset, 0, pixels, has_planes)};
  for (;; *clock += 1) {
    const umbel::StreamStep step = residency.step(view, *clock);
    if (step.caught_up && step.missing_groups == 0 && step.loaded == 0) break;
  }
  std::vector<double> times;
  double evaluated = 0, open = 0;
  int behind = 0;
  for (int frame = 0; frame < frames; ++frame, *clock += 1) {
    view[0] = seen(asset, frame, pixels, has_planes);
    const double start = processor_seconds();
    const umbel::StreamStep step = residency.step(view, *clock);
    times.push_back(1e3 * (processor_seconds() - start));
    evaluated += step.evaluated;
    open += step.open_groups;
    behind += !step.caught_up;
  }
  std::sort(times.begin(), times.end());
  double sum = 0;
  for (const double time : times) sum += time;
  printf(
      "%5.2f pixels, %-6s %7.0f open, %7zu clusters: mean %.3f, 99 %% %.3f, worst %.3f ms; "
      "evaluated %5.0f, behind in %4.1f %% of steps\n",
      pixels, has_planes ? "planes" : "all", open / frames, residency.cut().size(), sum / frames,
      times[times.size() * 99 / 100], times.back(), evaluated / frames, 100.0 * behind / frames);
}

}  // namespace

int main(int argc, char** argv) {
  int subdivisions = 9;
  double seconds = 10;
  umbel::ResidencyConfig config;
  config.budget_bytes = config.bytes_per_step = uint64_t{1} << 60;
  config.loads_in_flight = 1u << 30;
  for (int i = 1; i + 1 < argc; i += 2) {
    const double value = std::strtod(argv[i + 1], nullptr);
    if (strcmp(argv[i], "--subdivisions") == 0) subdivisions = static_cast<int>(value);
    if (strcmp(argv[i], "--groups-per-step") == 0)
      config.groups_per_step = static_cast<uint32_t>(value);
    if (strcmp(argv[i], "--seconds") == 0) seconds = value;
  }
  umbel::lod::Config small;
  small.max_triangles = 16;
  small.min_group = 4;
  small.max_group = 7;
  const umbel::Mesh mesh = umbel::shapes::blob(static_cast<uint32_t>(subdivisions), 0);
  const umbel::Aabb box = umbel::bounds(mesh.view());
  small.position_step = std::exp2(std::ceil(std::log2((box.max.x - box.min.x) / 65535)));
  const auto path = std::filesystem::temp_directory_path() / "stream_bench.umbel";
  umbel::write_asset(path, umbel::lod::build(mesh.view(), small));
  const umbel::Asset asset(path);
  std::filesystem::remove(path);
  printf("%zu triangles, %u groups, %u pages\n", mesh.triangles.size(), asset.meshes()[0].groups,
         asset.info().pages);
  for (const float pixels : {1.0f, 0.3f, 0.1f, 0.02f})
    for (const bool has_planes : {false, true})
      measure(asset, config, pixels, has_planes, std::max(static_cast<int>(60 * seconds), 1));
  return 0;
}
