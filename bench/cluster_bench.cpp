// Clusters of at most 128 triangles: ours beside meshoptimizer's buildMeshletsSpatial, in one
// process, on binary PLY meshes named on the command line. Prints medians and ratios.
//
//   cluster_bench [--runs N] [--short] MESH...
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "mesh_reader.hpp"
#include "meshoptimizer.h"
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

// One thing to time. Entries take turns, so that a disturbance hits all of them alike.
struct Entry {
  std::string name;
  std::function<void()> work;
  std::function<Result()> measure;
  bool wall = false;
  std::vector<double> times;

  void run() {
    const double start = now(wall);
    work();
    times.push_back(now(wall) - start);
  }
  double median() {
    std::sort(times.begin(), times.end());
    return times[times.size() / 2];
  }
};

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

Result measure(const umbel::ClusterInput& input, const umbel::Clusters& clusters) {
  const umbel::ClusterMetrics m = umbel::cluster_metrics(input, clusters, 128);
  return {0, m.mean_fill, m.surface_area_ratio, m.mean_vertices, m.min_size};
}

struct Meshlets {
  std::vector<meshopt_Meshlet> list;
  std::vector<unsigned> vertices;
  std::vector<unsigned char> triangles;
  size_t count = 0;
};

// The peer's triangles are new ones; they are measured as items of their own.
Result measure(const Mesh& mesh, const Meshlets& meshlets) {
  std::vector<uint32_t> corners;
  std::vector<Aabb> boxes;
  umbel::Clusters clusters;
  for (size_t c = 0; c < meshlets.count; ++c) {
    const meshopt_Meshlet& m = meshlets.list[c];
    clusters.ranges.push_back({uint32_t(boxes.size()), m.triangle_count});
    for (uint32_t t = 0; t < m.triangle_count; ++t) {
      Aabb box;
      for (int k = 0; k < 3; ++k) {
        const uint32_t corner = meshlets.triangles[m.triangle_offset + t * 3 + k];
        corners.push_back(meshlets.vertices[m.vertex_offset + corner]);
        grow(box, mesh.positions[corners.back()]);
      }
      clusters.items.push_back(uint32_t(boxes.size()));
      boxes.push_back(box);
    }
  }
  umbel::ClusterInput input;
  input.boxes = boxes;
  input.item_vertices = corners;
  input.vertices_per_item = 3;
  return measure(input, clusters);
}

Entry peer(const Mesh& mesh, size_t max_vertices) {
  const size_t indices = mesh.triangles.size() * 3;
  auto out = std::make_shared<Meshlets>();
  out->list.resize(meshopt_buildMeshletsBound(indices, max_vertices, 32));
  out->vertices.resize(indices);
  out->triangles.resize(indices);
  const auto work = [=, &mesh] {
    out->count = meshopt_buildMeshletsSpatial(out->list.data(), out->vertices.data(),
                                              out->triangles.data(), mesh.triangles[0].data(),
                                              indices, &mesh.positions[0].x, mesh.positions.size(),
                                              sizeof(umbel::Vec3), max_vertices, 32, 128, 0.5f);
  };
  return {"meshoptimizer v" + std::to_string(max_vertices),
          work,
          [=, &mesh] { return measure(mesh, *out); },
          false,
          {}};
}

Entry ours(const std::string& name, const Mesh& mesh, const umbel::ClusterInput& input,
           const umbel::ClusterConfig& config, uint32_t threads = 1) {
  auto clusters = std::make_shared<umbel::Clusters>();
  umbel::BuildOptions options;
  options.threads = threads;
  return {name,
          [=, &mesh] { *clusters = umbel::cluster_mesh(mesh.view(), config, 0.0f, options); },
          [=, &input] { return measure(input, *clusters); },
          threads != 1,
          {}};
}

std::vector<Entry> entries_for(const Mesh& mesh, const umbel::ClusterInput& input, bool all) {
  const umbel::ClusterConfig quality = umbel::cluster_preset("quality");
  std::vector<Entry> entries = {peer(mesh, 128), ours("quality", mesh, input, quality)};
  if (!all) return entries;
  entries.push_back(peer(mesh, 256));
  entries.push_back(ours("quality, 2 threads", mesh, input, quality, 2));
  for (const char* preset : {"fast", "exact"})
    entries.push_back(ours(preset, mesh, input, umbel::cluster_preset(preset)));
  umbel::ClusterConfig config = quality;
  config.presplit_threshold = 4096;
  entries.push_back(ours("quality, presplit 4096", mesh, input, config));
  config = quality;
  config.max_vertices = 128;
  entries.push_back(ours("quality, v128", mesh, input, config));
  config = quality;
  config.min_items = 96;
  entries.push_back(ours("quality, 96..128", mesh, input, config));
  return entries;
}

void print(const std::string& name, size_t triangles, const Result& r, const Result& base) {
  printf(
      "  %-24s %8.1f ms %7.2f M/s %6.2fx  fill %.3f  area ratio %7.3f (%.3f)"
      "  vertices %.1f  min %u\n",
      name.c_str(), r.seconds * 1e3, double(triangles) / r.seconds * 1e-6, base.seconds / r.seconds,
      r.fill, r.area_ratio, r.area_ratio / base.area_ratio, r.vertices, r.min_size);
  fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 5;
  std::map<std::string, std::vector<double>> ratios;
  bool all = true;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--runs" && i + 1 < argc) {
      runs = static_cast<int>(std::strtol(argv[++i], nullptr, 10));
      continue;
    }
    if (argument == "--short") {
      all = false;
      continue;
    }
    const Mesh mesh = bench::read_mesh(argument);
    const std::vector<Aabb> boxes = boxes_of(mesh);
    const umbel::ClusterInput input = input_of(mesh, boxes);
    const size_t n = mesh.triangles.size();
    printf("%s: %zu triangles\n", argument.c_str(), n);
    std::vector<Entry> entries = entries_for(mesh, input, all);
    for (int run = 0; run < runs; ++run)
      for (Entry& entry : entries) entry.run();
    Result base;
    for (size_t e = 0; e < entries.size(); ++e) {
      Result result = entries[e].measure();
      result.seconds = entries[e].median();
      if (e == 0) base = result;
      ratios[entries[e].name].push_back(base.seconds / result.seconds);
      print(entries[e].name, n, result, base);
    }
  }
  for (const auto& [name, of_meshes] : ratios) {
    double logarithms = 0;
    for (const double ratio : of_meshes) logarithms += std::log(ratio);
    printf("geometric mean %-24s %6.2fx\n", name.c_str(),
           std::exp(logarithms / double(of_meshes.size())));
  }
}
