// Continuous levels of detail: ours on one thread and on two beside meshoptimizer's clusterlod.h
// (on the one thread that it uses; its raster settings, or with --ray-tracing those), with the same
// meshoptimizer, in one program. Every measurement runs in a process of its own, so that peaks of
// memory are apart.
//
// With --processor-time seconds are those of all threads together, for a machine that is busy with
// other things. With --attributes meshes get normals, of the triangles around each vertex, and
// texture coordinates, by a projection; clusterlod.h weighs them as its demo does normals.
//
//   lod_bench [--runs N] [--triangles N] [--samples N] [--processor-time] [--measured-error]
//             [--attributes] [--ray-tracing] MESH...
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "arguments.hpp"
#include "base/math.hpp"
#include "closest_point.hpp"
#include "mesh_reader.hpp"
#include "peak_memory.hpp"
#include "umbel/lod.hpp"

#ifdef UMBEL_HAS_CLUSTERLOD
#include "meshoptimizer.h"
#ifndef __clang_analyzer__  // it is not ours to analyse
#define CLUSTERLOD_IMPLEMENTATION
#endif
#include "clusterlod.h"
#endif

namespace {

using umbel::kNone;
namespace lod = umbel::lod;

constexpr uint32_t kMaxTriangles = 128;

struct Options {
  int runs = 5;
  uint64_t triangles = 10000;
  size_t samples = 400000;
  bool processor_time = false;
  bool measured_error = false;
  bool attributes = false;
  bool ray_tracing = false;
  std::vector<std::string> meshes;
};

/// What a measurement says, plain bytes to go through a pipe.
struct Outcome {
  double seconds = 0, peak_mib = 0, fill = 0, cut_error = 0;
  uint64_t input_triangles = 0, clusters = 0, levels = 0, cut_triangles = 0;
  double diagonal = 0;
  bench::Deviation deviation;
};
static_assert(std::is_trivially_copyable_v<Outcome>);

double seconds_now(bool of_processor) {
  if (of_processor) return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double median_seconds(const Options& options, const std::function<void()>& work) {
  std::vector<double> times;
  for (int i = 0; i < options.runs; ++i) {
    const double start = seconds_now(options.processor_time);
    work();
    times.push_back(seconds_now(options.processor_time) - start);
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

double diagonal_of(const umbel::Mesh& mesh) {
  const umbel::Aabb box = umbel::bounds(mesh.view());
  return umbel::is_empty(box) ? 0 : umbel::length(box.max - box.min);
}

void add_attributes(umbel::Mesh& mesh) {
  const size_t count = mesh.positions.size();
  const float diagonal = static_cast<float>(diagonal_of(mesh));
  mesh.normals.assign(count, {0, 0, 0});
  mesh.uvs.resize(count);
  for (const umbel::Triangle& t : mesh.triangles) {
    const umbel::Vec3& origin = mesh.positions[t[0]];
    const umbel::Vec3 n =
        umbel::cross(mesh.positions[t[1]] - origin, mesh.positions[t[2]] - origin);
    for (uint32_t v : t) mesh.normals[v] = mesh.normals[v] + n;
  }
  for (size_t v = 0; v < count; ++v) {
    const float size = umbel::length(mesh.normals[v]);
    if (size > 0) mesh.normals[v] = mesh.normals[v] * (1 / size);
    mesh.uvs[v] = {mesh.positions[v].x / diagonal, mesh.positions[v].y / diagonal};
  }
}

void measure_cut(const umbel::Mesh& source, const umbel::Mesh& cut, size_t samples,
                 Outcome& outcome) {
  outcome.cut_triangles = cut.triangles.size();
  outcome.deviation = bench::two_sided_deviation(source, bench::ClosestPoint(source), cut, samples);
}

double fill_of(uint64_t triangles, uint64_t clusters) {
  return clusters ? static_cast<double>(triangles) / (static_cast<double>(clusters) * kMaxTriangles)
                  : 0;
}

Outcome measure_ours(const umbel::Mesh& mesh, const Options& options, uint32_t threads,
                     bool with_cut) {
  lod::Config config;
  config.max_triangles = config.max_vertices = kMaxTriangles;
  config.measured_error = options.measured_error;
  umbel::BuildOptions build_options;
  build_options.threads = threads;
  Outcome outcome;
  lod::Dag dag;
  outcome.peak_mib = bench::peak_mib([&] { dag = lod::build(mesh.view(), config, build_options); });
  outcome.seconds =
      median_seconds(options, [&] { dag = lod::build(mesh.view(), config, build_options); });
  outcome.clusters = dag.tables.clusters.size();
  outcome.levels = dag.tables.levels.size();
  outcome.fill = fill_of(dag.cluster_triangles.size() / 3, outcome.clusters);
  if (!with_cut) return outcome;
  const float error = lod::error_for_triangles(dag.tables, options.triangles);
  const std::vector<uint32_t> cut = lod::select(dag.tables, lod::view_error(error));
  outcome.cut_error = lod::cut_error(dag.tables, cut);
  measure_cut(mesh,
              lod::mesh_of_cut(
                  dag.tables, [&](uint32_t c) { return dag.geometry(c); }, cut),
              options.samples, outcome);
  return outcome;
}

#ifdef UMBEL_HAS_CLUSTERLOD

/// What clusterlod.h's output is kept as: the least that a renderer would keep.
struct PeerDag {
  lod::Tables tables;
  std::vector<uint32_t> offsets{0}, indices;

  void clear() { *this = PeerDag(); }

  int add(const clodGroup& group, const clodCluster* clusters, size_t count) {
    const uint32_t g = static_cast<uint32_t>(tables.groups.size());
    lod::Group entry{};
    entry.clusters = {static_cast<uint32_t>(tables.clusters.size()), static_cast<uint32_t>(count)};
    entry.level = static_cast<uint32_t>(group.depth);
    entry.error = group.simplified.error == std::numeric_limits<float>::max()
                      ? std::numeric_limits<float>::infinity()
                      : group.simplified.error;
    tables.groups.push_back(entry);
    for (size_t i = 0; i < count; ++i) {
      const clodCluster& cluster = clusters[i];
      lod::Cluster c{};
      c.group = g;
      c.generating_group = cluster.refined < 0 ? kNone : static_cast<uint32_t>(cluster.refined);
      c.triangle_count = static_cast<uint32_t>(cluster.index_count / 3);
      c.vertex_count = static_cast<uint32_t>(cluster.vertex_count);
      tables.clusters.push_back(c);
      indices.insert(indices.end(), cluster.indices, cluster.indices + cluster.index_count);
      offsets.push_back(static_cast<uint32_t>(indices.size()));
    }
    return static_cast<int>(g);
  }

  umbel::Mesh mesh(const umbel::Mesh& source, const std::vector<uint32_t>& cut) const {
    umbel::Mesh mesh;
    mesh.positions = source.positions;
    for (const uint32_t c : cut)
      for (uint32_t i = offsets[c]; i < offsets[c + 1]; i += 3)
        mesh.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
    return mesh;
  }
};

void build_peer(const umbel::Mesh& source, const Options& options, PeerDag& dag) {
  clodMesh mesh = {};
  mesh.indices = source.triangles[0].data();
  mesh.index_count = source.triangles.size() * 3;
  mesh.vertex_count = source.positions.size();
  mesh.vertex_positions = &source.positions[0].x;
  mesh.vertex_positions_stride = sizeof(umbel::Vec3);
  constexpr std::array kWeights{0.5f, 0.5f, 0.5f, 0.5f, 0.5f};
  std::vector<std::array<float, kWeights.size()>> attributes;
  for (size_t v = 0; v < source.normals.size(); ++v) {
    const umbel::Vec3& n = source.normals[v];
    attributes.push_back({n.x, n.y, n.z, source.uvs[v].x, source.uvs[v].y});
  }
  if (!attributes.empty()) {
    mesh.vertex_attributes = attributes[0].data();
    mesh.vertex_attributes_stride = sizeof attributes[0];
    mesh.attribute_weights = kWeights.data();
    mesh.attribute_count = kWeights.size();
  }
  dag.clear();
  clodBuild((options.ray_tracing ? clodDefaultConfigRT : clodDefaultConfig)(kMaxTriangles), mesh,
            [&](clodGroup group, const clodCluster* clusters, size_t count) {
              return dag.add(group, clusters, count);
            });
}

Outcome measure_peer(const umbel::Mesh& mesh, const Options& options) {
  Outcome outcome;
  PeerDag dag;
  outcome.peak_mib = bench::peak_mib([&] { build_peer(mesh, options, dag); });
  outcome.seconds = median_seconds(options, [&] { build_peer(mesh, options, dag); });
  outcome.clusters = dag.tables.clusters.size();
  for (const lod::Group& group : dag.tables.groups)
    outcome.levels = std::max<uint64_t>(outcome.levels, group.level + 1);
  outcome.fill = fill_of(dag.indices.size() / 3, outcome.clusters);
  const float error = lod::error_for_triangles(dag.tables, options.triangles);
  const std::vector<uint32_t> cut = lod::select(dag.tables, lod::view_error(error));
  outcome.cut_error = lod::cut_error(dag.tables, cut);
  measure_cut(mesh, dag.mesh(mesh, cut), options.samples, outcome);
  return outcome;
}

#endif

/// Runs one measurement in a process of its own.
Outcome in_child(const std::string& path, const Options& options,
                 const std::function<Outcome(const umbel::Mesh&)>& measure) {
  int ends[2];
  if (pipe(ends) != 0) bench::fail(path, "no pipe");
  std::fflush(stdout);
  const pid_t child = fork();
  if (child < 0) bench::fail(path, "no process");
  if (child == 0) {
    close(ends[0]);
    try {
      umbel::Mesh mesh = bench::read_mesh(path);
      if (mesh.triangles.empty()) bench::fail(path, "has no triangles");
      if (options.attributes) add_attributes(mesh);
      Outcome outcome = measure(mesh);
      outcome.input_triangles = mesh.triangles.size();
      outcome.diagonal = diagonal_of(mesh);
      const ssize_t written = write(ends[1], &outcome, sizeof outcome);
      _exit(written == ssize_t{sizeof outcome} ? 0 : 1);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s: %s\n", path.c_str(), error.what());
      _exit(1);
    }
  }
  close(ends[1]);
  Outcome outcome;
  const ssize_t got = read(ends[0], &outcome, sizeof outcome);
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (status != 0 || got != ssize_t{sizeof outcome}) std::exit(1);
  return outcome;
}

void print_row(const std::string& mesh, const char* what, const Outcome& o, const Outcome& base) {
  std::printf("| %s | %s | %.3f | %.2f | %.2f | %.0f | %.1f | %llu | %llu |", mesh.c_str(), what,
              o.seconds, base.seconds / o.seconds,
              static_cast<double>(o.input_triangles) / o.seconds / 1e6, o.peak_mib, 100 * o.fill,
              static_cast<unsigned long long>(o.levels),
              static_cast<unsigned long long>(o.clusters));
  if (o.cut_triangles == 0) {
    std::printf(" | | | | |\n");
    return;
  }
  const double unit = 1e-6 * o.diagonal;
  std::printf(" %llu | %.1f | %.2f | %.2f | %.1f |\n",
              static_cast<unsigned long long>(o.cut_triangles), o.cut_error / unit,
              o.deviation.mean / unit, o.deviation.rms / unit, o.deviation.max / unit);
}

void measure_mesh(const std::string& path, const Options& options) {
  const std::string name = path.substr(path.find_last_of('/') + 1);
  const Outcome one = in_child(
      path, options, [&](const umbel::Mesh& mesh) { return measure_ours(mesh, options, 1, true); });
  Outcome base = one;
#ifdef UMBEL_HAS_CLUSTERLOD
  base =
      in_child(path, options, [&](const umbel::Mesh& mesh) { return measure_peer(mesh, options); });
  print_row(name, "clusterlod.h", base, base);
#endif
  print_row(name, "umbel, 1 thread", one, base);
  const Outcome two = in_child(path, options, [&](const umbel::Mesh& mesh) {
    return measure_ours(mesh, options, 2, false);
  });
  print_row(name, "umbel, 2 threads", two, base);
}

std::string machine() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

Options parse(int count, char** arguments) {
  Options options;
  options.meshes = bench::read_arguments(
      count, arguments,
      {{"--runs", [&](uint64_t n) { options.runs = static_cast<int>(n); }},
       {"--triangles", [&](uint64_t n) { options.triangles = n; }},
       {"--samples", [&](uint64_t n) { options.samples = std::max<uint64_t>(2, n); }},
       {"--processor-time", &options.processor_time},
       {"--measured-error", &options.measured_error},
       {"--attributes", &options.attributes},
       {"--ray-tracing", &options.ray_tracing}},
      "[--runs N] [--triangles N] [--samples N] [--processor-time] [--measured-error] "
      "[--attributes] [--ray-tracing] MESH...");
  return options;
}

}  // namespace

int main(int count, char** arguments) {
  const Options options = parse(count, arguments);
  std::printf(
      "%s, %u hardware threads. Median of %d runs, %s time. Distances are those of the cut with at "
      "most %llu triangles\nto the source and back, %zu samples, in millionths of the "
      "source's diagonal; \"promised\" is the error that the\nbuilder states for the cut.\n\n",
      machine().c_str(), std::thread::hardware_concurrency(), options.runs,
      options.processor_time ? "processor" : "elapsed",
      static_cast<unsigned long long>(options.triangles), options.samples);
  std::printf(
      "| mesh | builder | seconds | speed-up | M triangles/s | peak MiB | fill %% | levels | "
      "clusters | cut | promised | mean | RMS | max |\n"
      "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const std::string& path : options.meshes) measure_mesh(path, options);
}
