// The path tracer on one core: paths and rays a second of processor time, and how much of that the
// same number of rays would take as plain queries, camera rays and then diffuse bounces. Medians
// of interleaved repetitions, as Markdown.
//
//   trace_bench [--runs N] [--size PIXELS] [--samples N] MESH.ply...
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "ply_reader.hpp"
#include "trace/camera.hpp"
#include "trace/sampler.hpp"
#include "trace/vector.hpp"
#include "umbel/trace.hpp"

namespace {

using namespace umbel;

struct Options {
  size_t runs = 5;
  uint32_t size = 256, samples = 4;
  std::vector<std::string> meshes;
};

double cpu_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// One ray through every pixel for each sample, in the order of the tracer's tiles.
std::vector<Ray> camera_rays(const trace::Camera& camera, const Options& options) {
  const trace::RayCamera rays(camera, options.size, options.size);
  std::vector<Ray> result;
  const uint32_t across = options.size / 16;
  for (uint32_t tile = 0; tile < across * across; ++tile) {
    const uint32_t left = tile % across * 16, top = tile / across * 16;
    for (uint32_t i = 0; i < 256 * options.samples; ++i) {
      const uint32_t pixel = i / options.samples, row = pixel / 16, column = pixel % 16;
      const Vec2 u = trace::Sampler(1, tile, i).point(0);
      const float x = static_cast<float>(left + column) + u.x;
      const float y = static_cast<float>(top + row) + u.y;
      result.push_back(rays.ray(x, y, {0, 0}));
    }
  }
  return result;
}

/// A diffuse bounce from each hit.
std::vector<Ray> bounces(const Mesh& mesh, const std::vector<Ray>& rays,
                         const TriangleQueries& structure) {
  using trace::operator*, trace::operator-;
  const float offset = 1e-5f * length(structure.bounds().max - structure.bounds().min);
  std::vector<Ray> result;
  for (size_t i = 0; i < rays.size(); ++i) {
    const Hit hit = structure.intersect(rays[i]);
    if (!hit.hit()) continue;
    const Triangle& t = mesh.triangles[hit.primitive];
    const Vec3 p = mesh.positions[t[0]];
    Vec3 normal =
        trace::normalized(cross(mesh.positions[t[1]] - p, mesh.positions[t[2]] - p), {0, 1, 0});
    if (dot(normal, rays[i].direction) > 0) normal = -normal;
    const Vec2 disc = trace::on_disc(trace::Sampler(2, static_cast<uint32_t>(i), 0).point(0));
    const float z = std::sqrt(std::max(0.0f, 1.0f - disc.x * disc.x - disc.y * disc.y));
    Ray ray;
    ray.origin = rays[i].origin + rays[i].direction * hit.t + normal * offset;
    ray.direction = trace::frame_around(normal).to_world({disc.x, disc.y, z});
    result.push_back(ray);
  }
  return result;
}

double rate_of(const TriangleQueries& structure, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  const double start = cpu_seconds();
  structure.intersect(rays, hits, {}, 1);
  return static_cast<double>(rays.size()) / (cpu_seconds() - start);
}

void run_mesh(const std::string& path, const Options& options) {
  const Mesh mesh = bench::read_ply(path);
  const trace::Scene scene = trace::Scene::build(mesh.view());
  const trace::Camera camera = trace::auto_camera(scene, options.size, options.size);
  const std::vector<Ray> primary = camera_rays(camera, options);
  const std::vector<Ray> bounce = bounces(mesh, primary, scene.structure());
  trace::Settings settings;
  settings.width = settings.height = options.size;
  settings.samples = options.samples;
  std::vector<double> seconds, primary_rates, bounce_rates;
  trace::Statistics counts;
  for (size_t run = 0; run < options.runs; ++run) {
    const double start = cpu_seconds();
    counts = trace::render(scene, camera, settings, {.progress = {}, .threads = 1}).statistics;
    seconds.push_back(cpu_seconds() - start);
    primary_rates.push_back(rate_of(scene.structure(), primary));
    bounce_rates.push_back(rate_of(scene.structure(), bounce));
  }
  const double time = median(seconds);
  const auto first = static_cast<double>(counts.primary), all = static_cast<double>(counts.rays());
  const double queries = first / median(primary_rates) + (all - first) / median(bounce_rates);
  const std::string name = path.substr(path.find_last_of('/') + 1);
  printf("| %s | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f |\n", name.c_str(), first / time * 1e-6,
         all / first, all / time * 1e-6, median(primary_rates) * 1e-6, median(bounce_rates) * 1e-6,
         queries / time);
  fflush(stdout);
}

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto number = [&] {
      if (++i == argc) bench::fail(word, "needs a number");
      return static_cast<uint32_t>(std::max(1L, std::strtol(argv[i], nullptr, 10)));
    };
    if (word == "--runs")
      options.runs = number();
    else if (word == "--size")
      options.size = std::max(number() / 16, 1u) * 16;
    else if (word == "--samples")
      options.samples = number();
    else
      options.meshes.push_back(word);
  }
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
