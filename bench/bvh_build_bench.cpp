// Times every builder of binary trees on binary PLY or plain OBJ meshes named on the command line,
// on one thread and on two: medians, million triangles a second, and what the trees cost.
//
//   bvh_build_bench [--runs N] [--builder NAME]... MESH...
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "clocks.hpp"
#include "mesh_reader.hpp"
#include "umbel/bvh.hpp"

namespace {

namespace bvh = umbel::bvh;

double seconds(const umbel::Mesh& mesh, const bvh::Config& config, uint32_t threads,
               bvh::Bvh2& tree) {
  umbel::BuildOptions options;
  options.threads = threads;
  tree = {};
  const double start = bench::wall_seconds();
  tree = bvh::build(mesh.view(), config, options);
  return bench::wall_seconds() - start;
}

void measure(const umbel::Mesh& mesh, const bvh::Config& config, int runs) {
  std::vector<double> one, two;
  bvh::Bvh2 tree;
  for (int i = 0; i < runs; ++i) {
    one.push_back(seconds(mesh, config, 1, tree));
    two.push_back(seconds(mesh, config, 2, tree));
  }
  const bvh::Statistics s = bvh::statistics(tree, {3, 2});
  const double t1 = bench::median(one), t2 = bench::median(two);
  std::printf("  %-14s %8.4f %8.4f %5.2f %8.2f %9.3f %9.3f %9u %9u %5u\n",
              std::string(bvh::name(config.builder)).c_str(), t1, t2, t1 / t2,
              double(mesh.triangles.size()) / t1 * 1e-6, s.sah_cost, bvh::sah_cost(tree, {1, 1}),
              s.nodes, s.leaves, s.max_depth);
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 5;
  std::vector<bvh::Builder> builders;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--runs") && i + 1 < argc)
      runs = std::max(static_cast<int>(std::strtol(argv[++i], nullptr, 10)), 1);
    else if (!std::strcmp(argv[i], "--builder") && i + 1 < argc)
      builders.push_back(bvh::builder_by_name(argv[++i]));
    else
      paths.emplace_back(argv[i]);
  }
  if (builders.empty()) builders.assign(bvh::builders().begin(), bvh::builders().end());
  for (const std::string& path : paths) {
    const umbel::Mesh mesh = bench::read_mesh(path);
    std::printf("%s: %zu triangles, medians of %d\n", path.c_str(), mesh.triangles.size(), runs);
    std::printf("  %-14s %8s %8s %5s %8s %9s %9s %9s %9s %5s\n", "builder", "1T s", "2T s", "x",
                "M tri/s", "SAH(3,2)", "SAH(1,1)", "nodes", "leaves", "depth");
    for (const bvh::Builder builder : builders) {
      bvh::Config config;
      config.builder = builder;
      measure(mesh, config, runs);
    }
  }
  return 0;
}
