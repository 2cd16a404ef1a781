// Single rays on one core: ours beside Embree 4 and tinybvh, in one program. Primary rays: three
// views in tiles of 4 x 4; bounce rays: one from each primary hit, cosine-distributed. Repetitions
// are interleaved, medians of processor time are printed, as Markdown, and hits are compared. Like
// is compared with like: our default with what the peers build without spatial splits, "best" with
// what they build with.
//
//   ray_bench [--embree LIBRARY] [--runs N] [--size PIXELS] [--only TEXT]
//             MESH.ply|MESH.obj...
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "base/parallel.hpp"
#include "bvh/wide/widen.hpp"
#include "ray_peers.hpp"
#include "traversal_counts.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/triangle_bvh.hpp"

namespace {

using bench::Embree, bench::Kind, bench::median, bench::Tracer;
using umbel::Hit, umbel::Mesh, umbel::Ray, umbel::Bvh, umbel::BvhConfig;

/// A tracer of ours that build() makes.
template <typename Build>
Tracer make_tracer(const std::string& name, const Mesh& mesh, const Build& build) {
  const double start = bench::thread_seconds();
  const auto tree = std::make_shared<decltype(build())>(build());
  Tracer tracer;
  tracer.name = name;
  tracer.is_ours = true;
  tracer.build_seconds = bench::thread_seconds() - start;
  tracer.bytes_per_triangle =
      static_cast<double>(tree->statistics().bytes) / static_cast<double>(mesh.triangles.size());
  tracer.trace = [tree](const std::vector<Ray>& rays, std::vector<Hit>& hits) {
    for (size_t i = 0; i < rays.size(); ++i) hits[i] = tree->intersect(rays[i]);
  };
  return tracer;
}

Tracer make_ours(const std::string& name, Kind kind, const Mesh& mesh, const BvhConfig& config) {
  Tracer tracer = make_tracer(name, mesh, [&] {
    return Bvh::build(mesh.view(), config, {}, {.progress = {}, .threads = 1});
  });
  tracer.kind = kind;
  return tracer;
}

Tracer make_kdtree(const std::string& name, const Mesh& mesh,
                   const umbel::kdtree::KdTreeConfig& config) {
  return make_tracer(name, mesh, [&] {
    return umbel::kdtree::KdTree::build(mesh.view(), config, {}, {.progress = {}, .threads = 1});
  });
}

struct Options {
  std::string embree;
  size_t runs = 5;
  uint32_t size = 1024;
  std::string only;
  std::vector<std::string> meshes;
};

/// How many hits differ by more than rounding: in distance, or hit against miss.
size_t disagreements(const std::vector<Hit>& a, const std::vector<Hit>& b) {
  size_t count = 0;
  for (size_t i = 0; i < a.size(); ++i)
    if (a[i].hit() != b[i].hit() || (a[i].hit() && std::fabs(a[i].t - b[i].t) > 1e-3f * a[i].t))
      ++count;
  return count;
}

using Factory = std::function<Tracer()>;

std::vector<Factory> make_factories(const Mesh& mesh, const Options& options, Embree* embree) {
  std::vector<Factory> factories;
  const auto add_ours = [&](const char* name, Kind kind, const BvhConfig& config) {
    if (!options.only.empty() && !std::strstr(name, options.only.c_str()) && !factories.empty())
      return;
    if (config.simd == umbel::Simd::kAvx2 && !__builtin_cpu_supports("avx2")) return;
    factories.push_back([=, &mesh] { return make_ours(name, kind, mesh, config); });
  };
  add_ours("umbel", Kind::kPlain, {});
  BvhConfig config;
  config.tree = umbel::bvh::preset("best");
  add_ours("umbel best", Kind::kSpatialSplits, config);
  config.tree = umbel::bvh::preset("fast");
  add_ours("umbel fast", Kind::kShown, config);
  config = {};
  config.tree.builder = umbel::bvh::Builder::kSweep;
  add_ours("umbel sweep", Kind::kShown, config);
  config = {};
  config.compact = true;
  add_ours("umbel compact", Kind::kShown, config);
  config = {};
  config.simd = umbel::Simd::kAvx2;
  add_ours("umbel AVX2", Kind::kShown, config);
  config.simd = umbel::Simd::kPortable;
  add_ours("umbel portable", Kind::kShown, config);
  config = {};
  config.width = 2;
  add_ours("umbel width 2", Kind::kShown, config);
  const auto add_kdtree = [&](const char* name, const umbel::kdtree::KdTreeConfig& config) {
    if (!options.only.empty() && !std::strstr(name, options.only.c_str())) return;
    factories.push_back([=, &mesh] { return make_kdtree(name, mesh, config); });
  };
  umbel::kdtree::KdTreeConfig kd;
  add_kdtree("umbel kd-tree, stack", kd);
  kd.traversal = umbel::kdtree::Traversal::kRopes;
  add_kdtree("umbel kd-tree, ropes", kd);
  kd.traversal = umbel::kdtree::Traversal::kShortStack;
  add_kdtree("umbel kd-tree, short stack", kd);
  kd = {};
  kd.tree.builder = umbel::kdtree::Builder::kBinned;
  add_kdtree("umbel kd-tree, binned", kd);
  kd = {};
  kd.compact = true;
  add_kdtree("umbel kd-tree, compact", kd);
  if (embree) {
    const auto add = [&](int quality, bool robust) {
      factories.push_back(
          [=, &mesh] { return bench::make_embree(*embree, quality, robust, mesh); });
    };
    for (int quality = 0; quality < 3; ++quality) add(quality, false);
    // Robust scenes have no spatial splits: HIGH would be the same again.
    add(1, true);
  }
#ifdef UMBEL_HAS_TINYBVH
  for (const bool splits : {false, true})
    factories.push_back([=, &mesh] { return bench::make_tinybvh(splits, mesh); });
#endif
  return factories;
}

/// Builds all in turn; the median counts.
std::vector<Tracer> make_tracers(const std::vector<Factory>& factories, size_t runs) {
  std::vector<Tracer> tracers(factories.size());
  std::vector<std::vector<double>> seconds(factories.size());
  for (size_t run = 0; run < runs; ++run)
    for (size_t i = 0; i < factories.size(); ++i) {
      tracers[i] = {};  // what it holds is not needed any more
      tracers[i] = factories[i]();
      seconds[i].push_back(tracers[i].build_seconds);
    }
  for (size_t i = 0; i < tracers.size(); ++i) tracers[i].build_seconds = median(seconds[i]);
  return tracers;
}

/// Traces with all tracers in turn; rays a second go to the member that `speeds` names.
std::vector<size_t> measure(std::vector<Tracer>& tracers, const std::vector<Ray>& rays,
                            std::vector<double> Tracer::* speeds, size_t runs,
                            std::vector<Hit>& reference) {
  std::vector<size_t> differences(tracers.size());
  reference.assign(rays.size(), {});
  std::vector<Hit> hits(rays.size());
  for (size_t run = 0; run <= runs; ++run)
    for (size_t i = 0; i < tracers.size(); ++i) {
      const double start = bench::thread_seconds();
      tracers[i].trace(rays, hits);
      const double seconds = bench::thread_seconds() - start;
      if (run > 0)
        (tracers[i].*speeds).push_back(1e-6 * static_cast<double>(rays.size()) / seconds);
      if (run > 0) continue;
      if (i == 0) reference = hits;
      differences[i] = disagreements(reference, hits);
    }
  return differences;
}

/// Ours over the best peer of its kind; builds over Embree's of the kind, MEDIUM or HIGH.
struct Ratios {
  std::string mesh;
  Kind kind;
  double build, primary, bounce;
};

double best_peer(const std::vector<Tracer>& tracers, Kind kind,
                 std::vector<double> Tracer::* speeds) {
  double best = 0;
  for (const Tracer& t : tracers)
    if (!t.is_ours && t.kind == kind) best = std::max(best, median(t.*speeds));
  return best;
}

void add_ratios(const std::string& mesh, const std::vector<Tracer>& tracers,
                std::vector<Ratios>& ratios) {
  for (const Tracer& t : tracers) {
    if (!t.is_ours || t.kind == Kind::kShown) continue;
    double build = 0;
    for (const Tracer& peer : tracers)
      if (peer.name == (t.kind == Kind::kPlain ? "Embree MEDIUM" : "Embree HIGH"))
        build = peer.build_seconds / t.build_seconds;
    const double primary = best_peer(tracers, t.kind, &Tracer::primary);
    const double bounce = best_peer(tracers, t.kind, &Tracer::bounce);
    if (primary > 0)
      ratios.push_back(
          {mesh, t.kind, build, median(t.primary) / primary, median(t.bounce) / bounce});
  }
}

void print_ratios(const std::vector<Ratios>& ratios, Kind kind, const char* title) {
  printf("\n%s\n\n| | build | primary | bounce |\n|---|--:|--:|--:|\n", title);
  double build = 0, primary = 0, bounce = 0;
  int count = 0;
  for (const Ratios& r : ratios) {
    if (r.kind != kind) continue;
    printf("| %s | %.3f | %.3f | %.3f |\n", r.mesh.c_str(), r.build, r.primary, r.bounce);
    build += std::log(r.build);
    primary += std::log(r.primary);
    bounce += std::log(r.bounce);
    ++count;
  }
  printf("| geometric mean | %.3f | %.3f | %.3f |\n", std::exp(build / count),
         std::exp(primary / count), std::exp(bounce / count));
}

void print_counts(const Mesh& mesh, const char* preset, const std::vector<Ray>& primary,
                  const std::vector<Ray>& bounce) {
  umbel::BvhData tree;
  umbel::with_threads(1, [&] {
    tree = umbel::widen_tree(umbel::bvh::build(mesh.view(), umbel::bvh::preset(preset)),
                             mesh.view(), {}, {});
  });
  umbel::prepare_rays(tree, umbel::Simd::kPortable);
  const auto p = bench::count_traversal(tree, primary), b = bench::count_traversal(tree, bounce);
  printf(
      "%s, a ray: primary %.2f nodes, %.2f leaves, %.2f triangles; "
      "bounce %.2f nodes, %.2f leaves, %.2f triangles\n",
      preset, p.nodes, p.leaves, p.triangles, b.nodes, b.leaves, b.triangles);
}

void run_mesh(const std::string& path, const Options& options, Embree* embree,
              std::vector<Ratios>& ratios) {
  const Mesh mesh = bench::read_mesh(path);
  std::vector<Tracer> tracers = make_tracers(make_factories(mesh, options, embree), options.runs);
  const std::vector<Ray> primary = bench::primary_rays(mesh, options.size);
  std::vector<Hit> hits, bounce_hits;
  const auto primary_differences = measure(tracers, primary, &Tracer::primary, options.runs, hits);
  const std::vector<Ray> bounce = bench::bounce_rays(mesh, primary, hits);
  const auto bounce_differences =
      measure(tracers, bounce, &Tracer::bounce, options.runs, bounce_hits);

  printf("\n%s: %zu triangles, %zu primary rays, %zu bounce rays, medians of %zu\n\n",
         bench::file_name(path).c_str(), mesh.triangles.size(), primary.size(), bounce.size(),
         options.runs);
  printf("| | build s | primary M/s | bounce M/s | B/triangle | other hits |\n");
  printf("|---|--:|--:|--:|--:|--:|\n");
  for (size_t i = 0; i < tracers.size(); ++i) {
    const Tracer& t = tracers[i];
    printf("| %s | %.3f | %.2f | %.2f | %.1f | %zu + %zu |\n", t.name.c_str(), t.build_seconds,
           median(t.primary), median(t.bounce), t.bytes_per_triangle, primary_differences[i],
           bounce_differences[i]);
  }
  add_ratios(bench::file_name(path), tracers, ratios);
  tracers.clear();
  printf("\n");
  for (const char* preset : {"quality", "best"}) print_counts(mesh, preset, primary, bounce);
  fflush(stdout);
}

Options parse(int argc, char** argv) {
  Options options;
  options.meshes = bench::read_arguments(
      argc, argv,
      {{"--embree", &options.embree},
       {"--runs", [&](uint64_t n) { options.runs = n; }},
       {"--size", [&](uint64_t n) { options.size = std::max(4u, static_cast<uint32_t>(n)); }},
       {"--only", &options.only}},
      "[--embree LIBRARY] [--runs N] [--size PIXELS] [--only TEXT] MESH...");
  return options;
}

/// As Linux names it.
std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown";
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = parse(argc, argv);
  const auto embree = options.embree.empty() ? nullptr : bench::open_embree(options.embree);
  printf("One core of %s\n\n", processor().c_str());
  std::vector<Ratios> ratios;
  for (const std::string& path : options.meshes) run_mesh(path, options, embree.get(), ratios);
  if (ratios.empty()) return 0;
  print_ratios(ratios, Kind::kPlain,
               "umbel over the fastest of the peers without spatial splits; build: Embree MEDIUM");
  print_ratios(ratios, Kind::kSpatialSplits,
               "umbel best over the fastest of the peers with spatial splits; build: Embree HIGH");
  return 0;
}
