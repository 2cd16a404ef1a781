// The path tracer on one core: paths and rays a second of processor time, and how much of that the
// same number of rays would take as plain queries, camera rays and then diffuse bounces. Medians
// of interleaved repetitions, as Markdown.
//
//   trace_bench [--runs N] [--size PIXELS] [--samples N] MESH...
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "clocks.hpp"
#include "mesh_reader.hpp"
#include "picture_rays.hpp"
#include "umbel/trace.hpp"

namespace {

using namespace umbel;

struct Options {
  size_t runs = 5;
  uint32_t size = 256, samples = 4;
  std::vector<std::string> meshes;
};

double rate_of(const TriangleQueries& structure, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  const double start = bench::process_seconds();
  structure.intersect(rays, hits, {}, 1);
  return static_cast<double>(rays.size()) / (bench::process_seconds() - start);
}

void run_mesh(const std::string& path, const Options& options) {
  const Mesh mesh = bench::read_mesh(path);
  const trace::Scene scene = trace::Scene::build(mesh.view());
  const umbel::Camera camera = trace::auto_camera(scene, options.size, options.size);
  const std::vector<Ray> primary = bench::camera_rays(camera, options.size, options.samples);
  const std::vector<Ray> bounce = bench::bounces(mesh, primary, scene.structure());
  trace::Settings settings;
  settings.width = settings.height = options.size;
  settings.samples = options.samples;
  std::vector<double> seconds, primary_rates, bounce_rates;
  trace::Statistics counts;
  for (size_t run = 0; run < options.runs; ++run) {
    const double start = bench::process_seconds();
    counts = trace::render(scene, camera, settings, {.progress = {}, .threads = 1}).statistics;
    seconds.push_back(bench::process_seconds() - start);
    primary_rates.push_back(rate_of(scene.structure(), primary));
    bounce_rates.push_back(rate_of(scene.structure(), bounce));
  }
  const double time = bench::median(seconds);
  const auto first = static_cast<double>(counts.primary), all = static_cast<double>(counts.rays());
  const double queries =
      first / bench::median(primary_rates) + (all - first) / bench::median(bounce_rates);
  const std::string name = path.substr(path.find_last_of('/') + 1);
  printf("| %s | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f |\n", name.c_str(), first / time * 1e-6,
         all / first, all / time * 1e-6, bench::median(primary_rates) * 1e-6,
         bench::median(bounce_rates) * 1e-6, queries / time);
  fflush(stdout);
}

Options parse(int argc, char** argv) {
  Options options;
  options.meshes = bench::read_arguments(
      argc, argv,
      {{"--runs", [&](uint64_t n) { options.runs = static_cast<uint32_t>(n); }},
       {"--size",
        [&](uint64_t n) { options.size = std::max(static_cast<uint32_t>(n) / 16, 1u) * 16; }},
       {"--samples", [&](uint64_t n) { options.samples = static_cast<uint32_t>(n); }}});
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = parse(argc, argv);
  printf(
      "Million a second of one core's processor time. The last column: what plain queries of as "
      "many rays take, over what tracing takes.\n\n");
  printf(
      "| mesh | paths | rays a path | rays | camera queries | bounce queries | queries / all |\n");
  printf("|---|--:|--:|--:|--:|--:|--:|\n");
  for (const std::string& mesh : options.meshes) run_mesh(mesh, options);
  return 0;
}
