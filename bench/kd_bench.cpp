// Times the builders of kd-trees on one thread and on two, on binary PLY or plain OBJ meshes named
// on the command line, and on meshes of 0.1 to 5 million triangles made here, to see how time
// grows: seconds over N log2 N should stay the same.
//
//   kd_bench [--runs N] [--grow] MESH...
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "clocks.hpp"
#include "mesh_reader.hpp"
#include "umbel/kdtree.hpp"

namespace {

namespace kdtree = umbel::kdtree;

struct Times {
  std::vector<double> processor, wall;
};

void time_build(const umbel::Mesh& mesh, const kdtree::Config& config, uint32_t threads,
                kdtree::Tree& tree, Times& times) {
  tree = {};
  const auto start = std::chrono::steady_clock::now();
  const double processor = bench::process_seconds();
  tree = kdtree::build(mesh.view(), config, {.progress = {}, .threads = threads});
  times.processor.push_back(bench::process_seconds() - processor);
  times.wall.push_back(
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

void measure(const std::string& label, const umbel::Mesh& mesh, int runs) {
  const auto count = static_cast<double>(mesh.triangles.size());
  for (const kdtree::Builder builder : {kdtree::Builder::kExact, kdtree::Builder::kBinned}) {
    kdtree::Config config;
    config.builder = builder;
    kdtree::Tree tree;
    Times one, two;
    for (int run = 0; run < runs; ++run) {
      time_build(mesh, config, 1, tree, one);
      time_build(mesh, config, 2, tree, two);
    }
    const kdtree::Statistics s = kdtree::statistics(tree);
    const double seconds = bench::median(one.processor);
    std::printf("| %s | %s | %.3f | %.3f | %.2f | %.2f | %.1f | %.2f | %.2f | %.2f | %.2f | %u |\n",
                label.c_str(), std::string(kdtree::name(builder)).c_str(), count * 1e-6, seconds,
                count / seconds * 1e-6, bench::median(one.wall) / bench::median(two.wall),
                1e9 * seconds / (count * std::log2(count)), s.sah_cost,
                static_cast<double>(s.references) / count,
                static_cast<double>(s.empty_leaves) / s.leaves, s.inner_visits + s.leaf_visits,
                s.max_depth);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 3;
  bool grow = false;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--runs") && i + 1 < argc)
      runs = std::max(static_cast<int>(std::strtol(argv[++i], nullptr, 10)), 1);
    else if (!std::strcmp(argv[i], "--grow"))
      grow = true;
    else
      paths.emplace_back(argv[i]);
  }
  std::printf("Medians of %d; seconds and M/s are processor time on one thread.\n\n", runs);
  std::printf(
      "| mesh | builder | M triangles | seconds | M/s | 2 threads x | ns per N log2 N | SAH |"
      " references a triangle | empty leaves | steps | depth |\n");
  std::printf("|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const std::string& path : paths)
    measure(path.substr(path.rfind('/') + 1), bench::read_mesh(path), runs);
  if (grow)
    for (const uint32_t side : {224u, 317u, 448u, 633u, 895u, 1265u, 1581u})
      measure("terrain", umbel::shapes::terrain(side, side, 1), runs);
  return 0;
}
