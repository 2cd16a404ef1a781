// Clusters of at most 128 triangles: ours beside meshoptimizer's buildMeshletsSpatial, in one
// process, on binary PLY meshes named on the command line. Prints medians and ratios.
//
//   cluster_bench [--runs N] [--threads N] MESH.ply...
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "meshoptimizer.h"
#include "ply_reader.hpp"
#include "umbel/cluster.hpp"

namespace {

using umbel::Aabb;
using umbel::Mesh;

struct Result {
  double seconds = 0, fill = 0, area_ratio = 0, vertices = 0;
  uint32_t min_size = 0;
};

// One thread is timed by the processor time that it used, so that other programs disturb less;
// several by the clock on the wall.
double now(bool wall) {
  timespec t;
  clock_gettime(wall ? CLOCK_MONOTONIC : CLOCK_PROCESS_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

double median_seconds(int runs, const std::function<void()>& work, bool wall = false) {
  std::vector<double> times;
  for (int i = 0; i < runs; ++i) {
    const double start = now(wall);
    work();
    times.push_back(now(wall) - start);
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

void grow(Aabb& box, const umbel::Vec3& p) {
  box.min = {std::min(box.min.x, p.x), std::min(box.min.y, p.y), std::min(box.min.z, p.z)};
  box.max = {std::max(box.max.x, p.x), std::max(box.max.y, p.y), std::max(box.max.z, p.z)};
}

std::vector<Aabb> boxes_of(const Mesh& mesh) {
  std::vector<Aabb> boxes(mesh.triangles.size());
  for (size_t i = 0; i < boxes.size(); ++i)
    for (const uint32_t v : mesh.triangles[i]) grow(boxes[i], mesh.positions[v]);
  return boxes;
}

umbel::ClusterInput input_of(const Mesh& mesh, const std::vector<Aabb>& boxes) {
  umbel::ClusterInput input;
  input.boxes = boxes;
  input.item_vertices = {reinterpret_cast<const uint32_t*>(mesh.triangles.data()),
                         mesh.triangles.size() * 3};
  input.vertices_per_item = 3;
  return input;
}

Result measure(const umbel::ClusterInput& input, const umbel::Clusters& clusters, double seconds) {
  const umbel::ClusterMetrics m = umbel::cluster_metrics(input, clusters, 128);
  return {seconds, m.mean_fill, m.surface_area_ratio, m.mean_vertices, m.min_size};
}

Result peer(const Mesh& mesh, const umbel::ClusterInput& input, int runs, size_t max_vertices) {
  const size_t indices = mesh.triangles.size() * 3;
  std::vector<meshopt_Meshlet> meshlets(meshopt_buildMeshletsBound(indices, max_vertices, 32));
  std::vector<unsigned> vertices(indices);
  std::vector<unsigned char> triangles(indices);
  size_t count = 0;
  const double seconds = median_seconds(runs, [&] {
    count = meshopt_buildMeshletsSpatial(meshlets.data(), vertices.data(), triangles.data(),
                                         mesh.triangles[0].data(), indices, &mesh.positions[0].x,
                                         mesh.positions.size(), sizeof(umbel::Vec3), max_vertices,
                                         32, 128, 0.5f);
  });
  // The peer's triangles are new ones; measure them as items of their own.
  std::vector<uint32_t> corners;
  std::vector<Aabb> boxes;
  umbel::Clusters clusters;
  for (size_t c = 0; c < count; ++c) {
    const meshopt_Meshlet& m = meshlets[c];
    clusters.ranges.push_back({uint32_t(boxes.size()), m.triangle_count});
    for (uint32_t t = 0; t < m.triangle_count; ++t) {
      Aabb box;
      for (int k = 0; k < 3; ++k) {
        const uint32_t v = vertices[m.vertex_offset + triangles[m.triangle_offset + t * 3 + k]];
        corners.push_back(v);
        grow(box, mesh.positions[v]);
      }
      clusters.items.push_back(uint32_t(boxes.size()));
      boxes.push_back(box);
    }
  }
  umbel::ClusterInput own = input;
  own.boxes = boxes;
  own.item_vertices = corners;
  return measure(own, clusters, seconds);
}

Result ours(const Mesh& mesh, const umbel::ClusterInput& input, int runs, uint32_t threads,
            const umbel::ClusterConfig& config) {
  umbel::BuildOptions options;
  options.threads = threads;
  umbel::Clusters clusters;
  const double seconds = median_seconds(
      runs, [&] { clusters = umbel::cluster_mesh(mesh.view(), config, 0.0f, options); },
      threads != 1);
  return measure(input, clusters, seconds);
}

void print(const std::string& name, size_t triangles, const Result& r, const Result& base) {
  printf("  %-28s %8.1f ms %7.2f M/s %6.2fx  fill %.3f  area ratio %7.3f (%.3f)  verts %.1f  min %u\n",
         name.c_str(), r.seconds * 1e3, double(triangles) / r.seconds * 1e-6,
         base.seconds / r.seconds, r.fill, r.area_ratio, r.area_ratio / base.area_ratio, r.vertices,
         r.min_size);
  fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 5;
  double product = 1;
  int meshes = 0;
  bool all = true;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--runs" && i + 1 < argc) {
      runs = std::atoi(argv[++i]);
      continue;
    }
    if (argument == "--short") {
      all = false;
      continue;
    }
    const Mesh mesh = bench::read_ply(argument);
    const std::vector<Aabb> boxes = boxes_of(mesh);
    const umbel::ClusterInput input = input_of(mesh, boxes);
    const size_t n = mesh.triangles.size();
    printf("%s: %zu triangles\n", argument.c_str(), n);
    const Result base = peer(mesh, input, runs, 128);
    print("meshoptimizer v128", n, base, base);
    umbel::ClusterConfig quality = umbel::cluster_preset("quality");
    const Result best = ours(mesh, input, runs, 1, quality);
    print("quality, 1 thread", n, best, base);
    product *= base.seconds / best.seconds;
    ++meshes;
    if (!all) continue;
    print("quality, 2 threads", n, ours(mesh, input, runs, 2, quality), base);
    print("fast, 1 thread", n, ours(mesh, input, runs, 1, umbel::cluster_preset("fast")), base);
    print("exact, 1 thread", n, ours(mesh, input, runs, 1, umbel::cluster_preset("exact")), base);
    umbel::ClusterConfig config = quality;
    config.presplit_threshold = 4096;
    print("presplit 4096, 1 thread", n, ours(mesh, input, runs, 1, config), base);
    config = quality;
    config.max_vertices = 128;
    print("quality, v128, 1 thread", n, ours(mesh, input, runs, 1, config), base);
    config = quality;
    config.min_items = 96;
    print("96..128, 1 thread", n, ours(mesh, input, runs, 1, config), base);
    if (n * 3 < 2000000) print("meshoptimizer v256", n, peer(mesh, input, runs, 256), base);
  }
  if (meshes) printf("geometric mean of quality's ratio: %.2fx\n", std::pow(product, 1.0 / meshes));
}
