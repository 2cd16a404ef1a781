// Whole default builds of Bvh and its refits on one thread and on two: medians by the clock
// on the wall, as a Markdown table of million triangles a second.
//
//   triangle_bvh_bench [--runs N] MESH.ply|MESH.obj...
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "clocks.hpp"
#include "mesh_reader.hpp"
#include "umbel/triangle_bvh.hpp"

namespace {

using umbel::BuildOptions, umbel::Mesh, umbel::Bvh, umbel::BvhConfig;

/// Seconds on one thread and on two, by turns.
struct Times {
  double one, two;
};

Times measure(size_t runs, const std::function<void(const BuildOptions&)>& work) {
  std::vector<double> seconds[2];
  for (size_t run = 0; run < runs; ++run)
    for (const uint32_t threads : {1u, 2u}) {
      const double start = bench::wall_seconds();
      work({.progress = {}, .threads = threads});
      seconds[threads - 1].push_back(bench::wall_seconds() - start);
    }
  return {bench::median(seconds[0]), bench::median(seconds[1])};
}

void print(const char* what, const Mesh& mesh, const Times& times) {
  const double millions = 1e-6 * static_cast<double>(mesh.triangles.size());
  std::printf("| %s | %.2f | %.2f | %.2f |\n", what, millions / times.one, millions / times.two,
              times.one / times.two);
}

void run_mesh(const std::string& path, size_t runs) {
  const Mesh mesh = bench::read_mesh(path);
  std::printf("| **%s** | | | |\n", bench::file_name(path).c_str());
  print("build", mesh, measure(runs, [&](const BuildOptions& options) {
          (void)Bvh::build(mesh.view(), {}, {}, options);
        }));
  for (const bool compact : {false, true}) {
    BvhConfig config;
    config.compact = compact;
    Bvh tree = Bvh::build(mesh.view(), config);
    print(
        compact ? "refit, compact" : "refit", mesh,
        measure(3 * runs, [&](const BuildOptions& options) { tree.refit(mesh.view(), options); }));
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  size_t runs = 5;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--runs") && i + 1 < argc)
      runs = std::max(1ul, std::strtoul(argv[++i], nullptr, 10));
    else
      paths.emplace_back(argv[i]);
  }
  if (paths.empty()) {
    std::fprintf(stderr, "triangle_bvh_bench [--runs N] MESH...\n");
    return 2;
  }
  std::printf("| M triangles/s | one thread | two threads | ratio |\n|---|--:|--:|--:|\n");
  for (const std::string& path : paths) run_mesh(path, runs);
  return 0;
}
