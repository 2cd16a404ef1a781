// How clusters scale: fractal height fields of 1, 4 and 16 million triangles, each preset on one
// thread. Prints nanoseconds and bytes a triangle, the bytes beyond the mesh and the result.
//
//   cluster_growth_bench [MILLIONS...]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "peak_memory.hpp"
#include "umbel/cluster.hpp"

namespace {

constexpr int kRuns = 3;

void measure(const umbel::Mesh& mesh, const char* preset) {
  const umbel::ClusterConfig config = umbel::cluster_preset(preset);
  umbel::BuildOptions options;
  options.threads = 1;
  const double triangles = double(mesh.triangles.size());
  std::vector<double> nanoseconds;
  double bytes = 0;
  for (int run = 0; run < kRuns; ++run) {
    umbel::Clusters clusters;
    const double peak = bench::peak_mib([&] {
      const std::clock_t start = std::clock();  // of the processor
      clusters = umbel::cluster_mesh(mesh.view(), config, 0.0f, options);
      nanoseconds.push_back(double(std::clock() - start) / CLOCKS_PER_SEC * 1e9 / triangles);
    });
    const double result = double(clusters.items.size() * sizeof(uint32_t) +
                                 clusters.ranges.size() * sizeof(umbel::Range));
    bytes = std::max(bytes, (peak * 1024 * 1024 - result) / triangles);
  }
  std::sort(nanoseconds.begin(), nanoseconds.end());
  printf("%10.0f triangles  %-8s %6.1f ns/triangle  %5.1f B/triangle\n", triangles, preset,
         nanoseconds[kRuns / 2], bytes);
  fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<double> millions;
  for (int i = 1; i < argc; ++i) millions.push_back(std::strtod(argv[i], nullptr));
  if (millions.empty()) millions = {1, 4, 16};
  for (const double m : millions) {
    const auto side = static_cast<uint32_t>(std::lround(std::sqrt(m * 1e6 / 2)));
    const umbel::Mesh mesh = umbel::shapes::terrain(side, side, 1);
    for (const char* preset : {"quality", "fast", "exact"}) measure(mesh, preset);
  }
}
