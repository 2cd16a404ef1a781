// Single rays on one core: ours beside Embree 4 (any libembree4, opened at run time) and tinybvh's
// BVH8_CPU (where CMake found it), in one program. Primary rays: three views in tiles of 4 x 4;
// bounce rays: one from each primary hit, cosine-distributed. Repetitions are interleaved, medians
// of processor time are printed, as Markdown, and hits are compared. Like is compared with like:
// our default with what the peers build without spatial splits, "best" with what they build with.
//
//   ray_bench [--embree LIBRARY] [--runs N] [--size PIXELS] [--only TEXT]
//             MESH.ply|MESH.obj...
#include <dlfcn.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "bvh/widen.hpp"
#include "mesh_reader.hpp"
#include "traversal_counts.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/triangle_bvh.hpp"

#ifdef UMBEL_HAS_TINYBVH
#define TINYBVH_IMPLEMENTATION
#include "tiny_bvh.h"
#endif

namespace {

using umbel::Aabb;
using umbel::Hit;
using umbel::Mesh;
using umbel::Ray;
using umbel::TriangleBvh;
using umbel::TriangleBvhConfig;
using umbel::Vec3;

double cpu_seconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Like is compared with like.
enum class Kind { kPlain, kSpatialSplits, kShown };

/// Anything that traces: built a few times, then traced many times.
struct Tracer {
  std::string name;
  Kind kind = Kind::kShown;
  bool is_ours = false;
  double build_seconds = 0;
  double bytes_per_triangle = 0;
  std::function<void(const std::vector<Ray>&, std::vector<Hit>&)> trace;
  std::vector<double> primary, bounce;
};

// ---------------------------------------------------------------- ours

Tracer make_ours(const std::string& name, Kind kind, const Mesh& mesh,
                 const TriangleBvhConfig& config) {
  const double start = cpu_seconds();
  const auto tree = std::make_shared<TriangleBvh>(
      TriangleBvh::build(mesh.view(), config, {}, {.progress = {}, .threads = 1}));
  Tracer tracer;
  tracer.name = name;
  tracer.kind = kind;
  tracer.is_ours = true;
  tracer.build_seconds = cpu_seconds() - start;
  tracer.bytes_per_triangle =
      static_cast<double>(tree->statistics().bytes) / static_cast<double>(mesh.triangles.size());
  tracer.trace = [tree](const std::vector<Ray>& rays, std::vector<Hit>& hits) {
    for (size_t i = 0; i < rays.size(); ++i) hits[i] = tree->intersect(rays[i]);
  };
  return tracer;
}

Tracer make_kdtree(const std::string& name, const Mesh& mesh,
                   const umbel::kdtree::KdTreeConfig& config) {
  const double start = cpu_seconds();
  const auto tree = std::make_shared<umbel::kdtree::KdTree>(
      umbel::kdtree::KdTree::build(mesh.view(), config, {}, {.progress = {}, .threads = 1}));
  Tracer tracer;
  tracer.name = name;
  tracer.is_ours = true;
  tracer.build_seconds = cpu_seconds() - start;
  tracer.bytes_per_triangle =
      static_cast<double>(tree->statistics().bytes) / static_cast<double>(mesh.triangles.size());
  tracer.trace = [tree](const std::vector<Ray>& rays, std::vector<Hit>& hits) {
    for (size_t i = 0; i < rays.size(); ++i) hits[i] = tree->intersect(rays[i]);
  };
  return tracer;
}

// ---------------------------------------------------------------- Embree, by its public C API

struct EmbreeRayHit {
  float origin[3], t_near, direction[3], time, t_far;
  uint32_t mask, id, flags;
  float normal[3], u, v;
  uint32_t primitive, geometry, instances[6];
};

struct Embree {
  void* (*new_device)(const char*);
  void* (*new_scene)(void*);
  void* (*new_geometry)(void*, int);
  void* (*new_buffer)(void*, int, uint32_t, int, size_t, size_t);
  void (*geometry_quality)(void*, int);
  void (*scene_quality)(void*, int);
  void (*commit_geometry)(void*);
  uint32_t (*attach)(void*, void*);
  void (*commit_scene)(void*);
  void (*release_scene)(void*);
  void (*release_geometry)(void*);
  void (*intersect)(void*, EmbreeRayHit*, void*);
  void (*monitor)(void*, bool (*)(void*, ssize_t, bool), void*);
  void* device;
  int64_t memory = 0;
};

template <typename Function>
void find(void* library, const char* name, Function*& function) {
  function = reinterpret_cast<Function*>(dlsym(library, name));
  if (!function) bench::fail(name, "not in Embree's library");
}

std::unique_ptr<Embree> open_embree(const std::string& path) {
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) bench::fail(path, dlerror());
  auto e = std::make_unique<Embree>();
  find(library, "rtcNewDevice", e->new_device);
  find(library, "rtcNewScene", e->new_scene);
  find(library, "rtcNewGeometry", e->new_geometry);
  find(library, "rtcSetNewGeometryBuffer", e->new_buffer);
  find(library, "rtcSetGeometryBuildQuality", e->geometry_quality);
  find(library, "rtcSetSceneBuildQuality", e->scene_quality);
  find(library, "rtcCommitGeometry", e->commit_geometry);
  find(library, "rtcAttachGeometry", e->attach);
  find(library, "rtcCommitScene", e->commit_scene);
  find(library, "rtcReleaseScene", e->release_scene);
  find(library, "rtcReleaseGeometry", e->release_geometry);
  find(library, "rtcIntersect1", e->intersect);
  find(library, "rtcSetDeviceMemoryMonitorFunction", e->monitor);
  e->device = e->new_device("threads=1,set_affinity=0");
  e->monitor(
      e->device,
      [](void* self, ssize_t bytes, bool) {
        static_cast<Embree*>(self)->memory += bytes;
        return true;
      },
      e.get());
  return e;
}

Tracer make_embree(Embree& e, const char* name, int quality, const Mesh& mesh) {
  constexpr int kTriangles = 0, kIndices = 0, kVertices = 1, kUint3 = 0x5003, kFloat3 = 0x9003;
  const double start = cpu_seconds();
  const std::shared_ptr<void> scene(e.new_scene(e.device), e.release_scene);
  void* const geometry = e.new_geometry(e.device, kTriangles);
  // Padded by one vertex, as Embree asks.
  void* const vertices =
      e.new_buffer(geometry, kVertices, 0, kFloat3, 12, mesh.positions.size() + 1);
  void* const indices = e.new_buffer(geometry, kIndices, 0, kUint3, 12, mesh.triangles.size());
  std::memcpy(vertices, mesh.positions.data(), 12 * mesh.positions.size());
  std::memcpy(indices, mesh.triangles.data(), 12 * mesh.triangles.size());
  const int64_t before = e.memory;
  e.geometry_quality(geometry, quality);
  e.scene_quality(scene.get(), quality);
  e.commit_geometry(geometry);
  e.attach(scene.get(), geometry);
  e.release_geometry(geometry);
  e.commit_scene(scene.get());
  Tracer tracer;
  tracer.name = std::string("Embree ") + name;
  tracer.kind = quality == 2 ? Kind::kSpatialSplits : Kind::kPlain;
  tracer.build_seconds = cpu_seconds() - start;
  tracer.bytes_per_triangle =
      static_cast<double>(e.memory - before) / static_cast<double>(mesh.triangles.size());
  tracer.trace = [&e, scene](const std::vector<Ray>& rays, std::vector<Hit>& hits) {
    alignas(64) EmbreeRayHit r{};
    for (size_t i = 0; i < rays.size(); ++i) {
      const Ray& ray = rays[i];
      std::memcpy(r.origin, &ray.origin, 12);
      std::memcpy(r.direction, &ray.direction, 12);
      r.t_near = ray.t_min;
      r.t_far = ray.t_max;
      r.mask = r.geometry = r.primitive = r.instances[0] = umbel::kNone;
      e.intersect(scene.get(), &r, nullptr);
      hits[i] = {r.t_far, r.geometry == umbel::kNone ? umbel::kNone : r.primitive, r.u, r.v};
    }
  };
  return tracer;
}

// ---------------------------------------------------------------- tinybvh

#ifdef UMBEL_HAS_TINYBVH
Tracer make_tinybvh(bool spatial_splits, const Mesh& mesh) {
  const auto corners = std::make_shared<std::vector<tinybvh::bvhvec4>>();
  for (const umbel::Triangle& triangle : mesh.triangles)
    for (const uint32_t vertex : triangle) {
      const Vec3& p = mesh.positions[vertex];
      corners->emplace_back(p.x, p.y, p.z, 0.0f);
    }
  const double start = cpu_seconds();
  const auto tree = std::make_shared<tinybvh::BVH8_CPU>();
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  if (spatial_splits)
    tree->BuildHQ(corners->data(), count);
  else
    tree->Build(corners->data(), count);
  Tracer tracer;
  tracer.name = spatial_splits ? "tinybvh BVH8 HQ" : "tinybvh BVH8";
  tracer.kind = spatial_splits ? Kind::kSpatialSplits : Kind::kPlain;
  tracer.build_seconds = cpu_seconds() - start;
  tracer.trace = [tree, corners](const std::vector<Ray>& rays, std::vector<Hit>& hits) {
    for (size_t i = 0; i < rays.size(); ++i) {
      const Ray& r = rays[i];
      tinybvh::Ray ray({r.origin.x, r.origin.y, r.origin.z},
                       {r.direction.x, r.direction.y, r.direction.z});
      tree->Intersect(ray);
      const bool is_hit = ray.hit.t < 1e29f;
      hits[i] = {ray.hit.t, is_hit ? ray.hit.prim : umbel::kNone, ray.hit.u, ray.hit.v};
    }
  };
  return tracer;
}
#endif

// ---------------------------------------------------------------- rays

Vec3 normalized(const Vec3& a) { return a * (1.0f / length(a)); }

/// Looks from `eye` to `target`; 4 x 4 tiles.
void add_view(const Vec3& eye, const Vec3& target, uint32_t size, std::vector<Ray>& rays) {
  const Vec3 forward = normalized(target - eye);
  const Vec3 up = std::fabs(forward.y) > 0.9f ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 right = normalized(cross(forward, up)), above = cross(right, forward);
  const float scale = 1.1f / static_cast<float>(size);  // a field of view of about 58 degrees
  for (uint32_t tile_y = 0; tile_y < size; tile_y += 4)
    for (uint32_t tile_x = 0; tile_x < size; tile_x += 4)
      for (uint32_t i = 0; i < 16; ++i) {
        const uint32_t column = tile_x + i % 4, row = tile_y + i / 4;
        const float x = (static_cast<float>(column) + 0.5f) * scale - 0.55f;
        const float y = (static_cast<float>(row) + 0.5f) * scale - 0.55f;
        Ray ray;
        ray.origin = eye;
        ray.direction = normalized(forward + right * x + above * y);
        rays.push_back(ray);
      }
}

/// Two from outside, one from the middle along the longest side.
std::vector<Ray> primary_rays(const Mesh& mesh, uint32_t size) {
  const Aabb box = bounds(mesh.view());
  const Vec3 extent = box.max - box.min, middle = center(box);
  const float reach = length(extent);
  std::vector<Ray> rays;
  add_view(middle + normalized({0.6f, 0.4f, 0.7f}) * reach, middle, size, rays);
  add_view(middle + normalized({-0.8f, 0.25f, -0.5f}) * (0.8f * reach), middle, size, rays);
  const Vec3 inside = middle + Vec3{0.05f * extent.x, 0.03f * extent.y, 0.02f * extent.z};
  const bool x_is_longest = extent.x >= extent.y && extent.x >= extent.z;
  add_view(inside,
           inside + (x_is_longest ? Vec3{reach, 0.05f * reach, 0.02f * reach}
                                  : Vec3{0.05f * reach, 0.02f * reach, reach}),
           size, rays);
  return rays;
}

float uniform(uint32_t seed) {
  seed ^= seed >> 16;
  seed *= 0x7feb352du;
  seed ^= seed >> 15;
  seed *= 0x846ca68bu;
  seed ^= seed >> 16;
  return static_cast<float>(seed >> 8) * 0x1p-24f;
}

std::vector<Ray> bounce_rays(const Mesh& mesh, const std::vector<Ray>& rays,
                             const std::vector<Hit>& hits) {
  const float offset = 1e-5f * length(bounds(mesh.view()).max - bounds(mesh.view()).min);
  std::vector<Ray> result;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (!hits[i].hit()) continue;
    const umbel::Triangle& triangle = mesh.triangles[hits[i].primitive];
    const Vec3 p0 = mesh.positions[triangle[0]];
    Vec3 normal = cross(mesh.positions[triangle[1]] - p0, mesh.positions[triangle[2]] - p0);
    if (!(length(normal) > 0)) continue;
    normal = normalized(normal);
    if (dot(normal, rays[i].direction) > 0) normal = normal * -1.0f;
    const auto seed = static_cast<uint32_t>(i);
    const float z = 1 - 2 * uniform(2 * seed), angle = 6.2831853f * uniform(2 * seed + 1);
    const float radius = std::sqrt(std::max(0.0f, 1 - z * z));
    const Vec3 direction =
        normal * 1.0001f + Vec3{radius * std::cos(angle), radius * std::sin(angle), z};
    Ray ray;
    ray.origin = rays[i].origin + rays[i].direction * hits[i].t + normal * offset;
    ray.direction = normalized(direction);
    result.push_back(ray);
  }
  return result;
}

// ---------------------------------------------------------------- measuring

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
  const auto add_ours = [&](const char* name, Kind kind, const TriangleBvhConfig& config) {
    if (!options.only.empty() && !std::strstr(name, options.only.c_str()) && !factories.empty())
      return;
    if (config.simd == umbel::Simd::kAvx2 && !__builtin_cpu_supports("avx2")) return;
    factories.push_back([=, &mesh] { return make_ours(name, kind, mesh, config); });
  };
  add_ours("umbel", Kind::kPlain, {});
  TriangleBvhConfig config;
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
    constexpr const char* kNames[] = {"LOW", "MEDIUM", "HIGH"};
    for (int quality = 0; quality < 3; ++quality)
      factories.push_back(
          [=, &mesh] { return make_embree(*embree, kNames[quality], quality, mesh); });
  }
#ifdef UMBEL_HAS_TINYBVH
  for (const bool splits : {false, true})
    factories.push_back([=, &mesh] { return make_tinybvh(splits, mesh); });
#endif
  return factories;
}

/// Builds all in turn, a few times; the median counts.
std::vector<Tracer> make_tracers(const std::vector<Factory>& factories, size_t runs) {
  std::vector<Tracer> tracers(factories.size());
  std::vector<std::vector<double>> seconds(factories.size());
  for (size_t run = 0; run < std::min<size_t>(runs, 3); ++run)
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
      const double start = cpu_seconds();
      tracers[i].trace(rays, hits);
      const double seconds = cpu_seconds() - start;
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
  umbel::TriangleBvhData tree;
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

double process_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// By the wall clock, and by the time of all processors together, which other programs disturb
/// less.
void print_refit(const Mesh& mesh, size_t runs) {
  using Clock = std::chrono::steady_clock;
  for (const bool compact : {false, true}) {
    TriangleBvhConfig config;
    config.compact = compact;
    TriangleBvh tree = TriangleBvh::build(mesh.view(), config);
    for (const uint32_t threads : {1u, 2u}) {
      std::vector<double> wall, processor;
      for (size_t run = 0; run < 3 * runs; ++run) {
        const auto start = Clock::now();
        const double processor_start = process_seconds();
        tree.refit(mesh.view(), {.progress = {}, .threads = threads});
        processor.push_back(process_seconds() - processor_start);
        wall.push_back(std::chrono::duration<double>(Clock::now() - start).count());
      }
      const double millions = 1e-6 * static_cast<double>(mesh.triangles.size());
      printf("refit%s, %u thread%s: %.1f M triangles/s, %.1f a second of one processor\n",
             compact ? " compact" : "", threads, threads == 1 ? "" : "s", millions / median(wall),
             millions / median(processor));
    }
  }
}

/// The default's whole build, as print_refit does it.
void print_build(const Mesh& mesh, size_t runs) {
  using Clock = std::chrono::steady_clock;
  for (const uint32_t threads : {1u, 2u}) {
    std::vector<double> wall, processor;
    for (size_t run = 0; run < runs; ++run) {
      const auto start = Clock::now();
      const double processor_start = process_seconds();
      const TriangleBvh tree =
          TriangleBvh::build(mesh.view(), {}, {}, {.progress = {}, .threads = threads});
      processor.push_back(process_seconds() - processor_start);
      wall.push_back(std::chrono::duration<double>(Clock::now() - start).count());
    }
    const double millions = 1e-6 * static_cast<double>(mesh.triangles.size());
    printf("build, %u thread%s: %.2f M triangles/s, %.2f a second of one processor\n", threads,
           threads == 1 ? "" : "s", millions / median(wall), millions / median(processor));
  }
}

void run_mesh(const std::string& path, const Options& options, Embree* embree,
              std::vector<Ratios>& ratios) {
  const Mesh mesh = bench::read_mesh(path);
  std::vector<Tracer> tracers = make_tracers(make_factories(mesh, options, embree), options.runs);
  const std::vector<Ray> primary = primary_rays(mesh, options.size);
  std::vector<Hit> hits, bounce_hits;
  const auto primary_differences = measure(tracers, primary, &Tracer::primary, options.runs, hits);
  const std::vector<Ray> bounce = bounce_rays(mesh, primary, hits);
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
  // Embree's "threads=1" is a limit for the whole process.
  if (!embree) {
    print_build(mesh, options.runs);
    print_refit(mesh, options.runs);
  }
  fflush(stdout);
}

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool has_value = i + 1 < argc;
    if (argument == "--embree" && has_value)
      options.embree = argv[++i];
    else if (argument == "--runs" && has_value)
      options.runs = std::max(1ul, std::strtoul(argv[++i], nullptr, 10));
    else if (argument == "--size" && has_value)
      options.size = static_cast<uint32_t>(std::max(4ul, std::strtoul(argv[++i], nullptr, 10)));
    else if (argument == "--only" && has_value)
      options.only = argv[++i];
    else
      options.meshes.push_back(argument);
  }
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = parse(argc, argv);
  if (options.meshes.empty()) {
    fprintf(stderr,
            "ray_bench [--embree LIBRARY] [--runs N] [--size PIXELS] [--only TEXT] MESH...\n");
    return 2;
  }
  const auto embree = options.embree.empty() ? nullptr : open_embree(options.embree);
  std::vector<Ratios> ratios;
  for (const std::string& path : options.meshes) run_mesh(path, options, embree.get(), ratios);
  if (ratios.empty()) return 0;
  print_ratios(ratios, Kind::kPlain,
               "umbel over the fastest of the peers without spatial splits; build: Embree MEDIUM");
  print_ratios(ratios, Kind::kSpatialSplits,
               "umbel best over the fastest of the peers with spatial splits; build: Embree HIGH");
  return 0;
}
