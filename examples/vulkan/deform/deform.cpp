// A mesh that bends, clustered again as it does: kept, rebuilt each frame, and by policies, with
// the milliseconds of each step as a table, and pictures.
//   umbel_vulkan_deform [FILE.umbel] [--frames N] [--out DIR] [--max-triangles N] [--size W H]
//                       [--validate]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <umbel/trace.hpp>
#include <vector>

#include "deform/deforming_renderer.hpp"
#include "heat_colors.hpp"
#include "options.hpp"
#include "png.hpp"
#include "scene.hpp"
#include "unavailable.hpp"

namespace {

using umbel::RebuildPolicy;

struct Way {
  const char* name;
  RebuildPolicy policy;
};

const Way kWays[] = {
    {"kept", {.threshold = 1e9}},
    {"rebuilt each frame", {.threshold = 1e9, .most_period = 1}},
    {"policy: growth of 1.15", {.threshold = 1.15}},
    {"policy: the worst tenth", {.threshold = 1.15, .budget = 0.1}},
};

umbel::Mesh finest_of(const std::string& file) {
  const umbel::Asset asset{std::filesystem::path(file)};
  umbel::Mesh mesh =
      umbel::mesh_of_clusters(asset, umbel::clusters_of_cut(asset, umbel::lod::view_level(0)));
  const umbel::Aabb& box = asset.info().bounds;
  for (umbel::Vec3& p : mesh.positions) {
    p = {p.x - 0.5f * (box.min.x + box.max.x), p.y - 0.5f * (box.min.y + box.max.y),
         p.z - 0.5f * (box.min.z + box.max.z)};
  }
  return mesh;
}

umbel::Camera camera_of(const umbel::Mesh& mesh) {
  float reach = 0;
  for (const umbel::Vec3& p : mesh.positions) {
    reach = std::max(reach, std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z));
  }
  umbel::Camera camera;
  camera.position = {1.2f * reach, 1.0f * reach, 2.6f * reach};
  return camera;
}

struct Sums {
  sample::DeformTimes times;
  double area_ratio = 0, worst = 0;
  uint32_t rebuilds = 0, frames = 0;
  void add(const sample::DeformReport& report) {
    times.deform += report.times.deform;
    times.clusters += report.times.clusters;
    times.structures += report.times.structures;
    times.scene += report.times.scene;
    times.trace += report.times.trace;
    area_ratio += report.growth.area_ratio;
    worst = std::max(worst, report.growth.area_ratio);
    rebuilds += report.action != RebuildPolicy::Action::kKeep;
    ++frames;
  }
};

// A heatmap, until all are there and their scale is known.
struct Heatmap {
  std::string file;
  std::vector<uint32_t> counts;
};

void write_heatmaps(const std::vector<Heatmap>& heatmaps, uint32_t width, uint32_t height) {
  uint32_t most = 1;
  for (const Heatmap& map : heatmaps) {
    most = std::max(most, *std::max_element(map.counts.begin(), map.counts.end()));
  }
  std::printf("heatmaps, from 0 to %u boxes:\n", most);
  for (const Heatmap& map : heatmaps) {
    uint64_t sum = 0, covered = 0;
    for (const uint32_t count : map.counts) {
      sum += count;
      covered += count > 0;
    }
    std::printf("  %s: %.1f boxes in the mean\n", map.file.c_str(),
                static_cast<double>(sum) / static_cast<double>(std::max<uint64_t>(covered, 1)));
    sample::write_png(map.file, width, height, sample::heat_colors(map.counts, most));
  }
}

void run(const sample::DeformOptions& options) {
  std::filesystem::create_directories(options.out);
  const umbel::Mesh mesh =
      options.file.empty() ? umbel::shapes::blob(6, 1) : finest_of(options.file);
  const sample::Device device(options.device);
  std::printf("%s, %zu triangles, at most %u a cluster, %u frames; milliseconds a frame\n",
              device.name().c_str(), mesh.triangles.size(), options.max_triangles, options.frames);
  std::printf("%-24s %8s %8s %8s %8s %8s %8s %10s %8s %9s\n", "", "deform", "cluster", "BLAS",
              "TLAS", "rays", "all", "area ratio", "worst", "rebuilds");
  std::ofstream csv(options.out + "/deform.csv");
  csv << "way,frame,deform,cluster,blas,tlas,rays,area_ratio,built\n";
  sample::FrameInput input;
  input.camera = camera_of(mesh);
  input.looks = sample::FrameInput::Looks::kClusters;
  std::vector<Heatmap> heatmaps;
  for (const Way& way : kWays) {
    sample::DeformingRenderer renderer(device, mesh, options.max_triangles, options.width,
                                       options.height);
    Sums sums;
    const auto number = std::to_string(&way - kWays);
    const auto draw_heatmap = [&](const std::string& pose) {
      heatmaps.push_back({options.out + "/heatmap_" + number + "_" + pose + ".png",
                          umbel::trace::boxes_per_pixel(renderer.clusters().boxes(), input.camera,
                                                        options.width, options.height)});
    };
    renderer.draw(0, way.policy, input);  // clusters at rest, beside the count
    draw_heatmap("rest");
    for (uint32_t f = 0; f < options.frames; ++f) {
      const float time = static_cast<float>(f + 1) / static_cast<float>(options.frames + 1);
      const sample::DeformReport report = renderer.draw(time, way.policy, input);
      sums.add(report);
      const sample::DeformTimes& t = report.times;
      csv << way.name << ',' << f << ',' << t.deform << ',' << t.clusters << ',' << t.structures
          << ',' << t.scene << ',' << t.trace << ',' << report.growth.area_ratio << ','
          << report.built << '\n';
      if (f == options.frames / 2) {
        draw_heatmap("bent");
        sample::write_png(options.out + "/deform_" + number + ".png", options.width, options.height,
                          renderer.pixels());
      }
    }
    const double n = sums.frames;
    const sample::DeformTimes& t = sums.times;
    std::printf("%-24s %8.2f %8.2f %8.2f %8.2f %8.2f %8.2f %10.3f %8.3f %9u\n", way.name,
                t.deform / n, t.clusters / n, t.structures / n, t.scene / n, t.trace / n,
                t.all() / n, sums.area_ratio / n, sums.worst, sums.rebuilds);
  }
  write_heatmaps(heatmaps, options.width, options.height);
  if (device.validation_messages() > 0) throw std::runtime_error("validation found faults.");
}

}  // namespace

int main(int argc, char** argv) try {
  run(sample::parse_deform_options(argc, argv));
  return EXIT_SUCCESS;
} catch (const sample::Unavailable& error) {
  std::fprintf(stderr, "umbel_vulkan_deform: skipped: %s\n", error.what());
  return 77;
} catch (const std::exception& error) {
  std::fprintf(stderr, "umbel_vulkan_deform: %s\n", error.what());
  return EXIT_FAILURE;
}
