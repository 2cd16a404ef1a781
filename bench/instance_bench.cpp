// What opening an asset of very many instances takes, and a step that selects from them.
//
//   instance_bench FILE.umbel [--height PIXELS] [--error PIXELS]
//
// A camera looks ahead and a little down, from the middle of the scene and from farther and farther
// away. Printed: the time and the memory to open the file and to read the nodes of its tree; then,
// for each place, pages and bytes that all steps read until nothing is missing, what is shown then,
// the triangles of its meshes' coarsest clusters, and the least and the mean processor time of 50
// steps.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <vector>

#include "base/math.hpp"
#include "peak_memory.hpp"
#include "umbel/instance_tree.hpp"

namespace {

using umbel::Vec3;

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// Triangles of a mesh's coarsest clusters.
uint64_t coarsest_triangles(const umbel::Asset& asset, uint32_t mesh) {
  return asset.walk(umbel::lod::view_error(1e30f), [](const umbel::CutGroup&) {}, mesh).triangles;
}

struct Look {
  const char* name;
  float distance;  ///< in radii of the scene, from its middle
};

void measure(const umbel::Asset& asset, const Look& look, uint32_t height, float pixels,
             const std::vector<uint64_t>& coarsest) {
  const umbel::InstanceNode& root = asset.instance_nodes()[0];
  const float radius = root.sphere.radius;
  const Vec3 eye = root.sphere.center + radius * look.distance * Vec3{0.1f, 0.35f, -0.93f} +
                   Vec3{0, 0.002f * radius, 0};
  const Vec3 target = look.distance > 0.5f ? root.sphere.center : eye + Vec3{0, -0.1f, 1};
  const umbel::Camera camera{eye, target, {0, 1, 0}, 1.0f};
  const auto view = umbel::lod::view_camera(eye, camera.fov_y, height, pixels);
  const auto planes = umbel::lod::frustum_planes(camera, 16.0f / 9);
  umbel::InstanceSelector selector(asset);
  uint64_t pages = 0, bytes = 0;
  umbel::InstanceStep step = selector.step(view, planes);
  for (; !step.missing.empty(); step = selector.step(view, planes)) {
    for (const uint32_t node : step.missing) bytes += asset.placement_bytes(node);
    pages += step.missing.size();
    selector.load(step.missing);
  }
  constexpr int kSteps = 50;
  double least = 1e9, sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double begun = processor_seconds();
    step = selector.step(view, planes);
    const double took = processor_seconds() - begun;
    least = std::min(least, took);
    sum += took;
  }
  uint64_t triangles = 0;
  for (const umbel::InstanceRun& run : step.runs)
    for (const umbel::Instance& instance : selector.placements(run))
      triangles += coarsest[instance.mesh];
  std::printf("%-10s %9llu %9llu %9llu %8zu %12llu %7llu %9.2f %9.3f %9.3f\n", look.name,
              static_cast<unsigned long long>(step.shown),
              static_cast<unsigned long long>(step.stand_ins),
              static_cast<unsigned long long>(step.refined), step.runs.size(),
              static_cast<unsigned long long>(triangles), static_cast<unsigned long long>(pages),
              1e-6 * static_cast<double>(bytes), 1e3 * least, 1e3 * sum / kSteps);
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "instance_bench FILE.umbel [--height PIXELS] [--error PIXELS]\n");
    return 2;
  }
  uint32_t height = 1080;
  float pixels = 1;
  for (int i = 2; i + 1 < count; i += 2) {
    if (std::strcmp(arguments[i], "--height") == 0)
      height = static_cast<uint32_t>(std::strtoul(arguments[i + 1], nullptr, 10));
    if (std::strcmp(arguments[i], "--error") == 0) pixels = std::strtof(arguments[i + 1], nullptr);
  }
  const double begun = processor_seconds();
  const umbel::Asset asset(arguments[1]);
  const double opened = processor_seconds();
  const auto& nodes = asset.instance_nodes();
  const double read = processor_seconds();
  std::printf(
      "%.1f MB, %u instances, %zu nodes: open %.2f ms, read nodes %.2f ms, "
      "memory %.1f MB\n",
      1e-6 * static_cast<double>(asset.info().file_bytes), nodes[0].instances, nodes.size(),
      1e3 * (opened - begun), 1e3 * (read - opened), bench::status_kib("VmHWM:") * 1024e-6);
  std::vector<uint64_t> coarsest;
  for (uint32_t m = 0; m < asset.meshes().size(); ++m)
    coarsest.push_back(coarsest_triangles(asset, m));
  std::printf("%-10s %9s %9s %9s %8s %12s %7s %9s %9s %9s\n", "from", "shown", "stand-ins",
              "refined", "runs", "triangles", "pages", "MB read", "least ms", "mean ms");
  for (const Look& look : {Look{"within", 0}, Look{"1 radius", 1}, Look{"4 radii", 4},
                           Look{"16 radii", 16}, Look{"64 radii", 64}, Look{"256 radii", 256}})
    measure(asset, look, height, pixels, coarsest);
}
