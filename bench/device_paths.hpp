// Whole pictures by path tracing on a device, or with the same code on the processor: what Meister
// and Bittner (2016) evaluate builders of hierarchies by. All builders' trees are built, and then
// each batch of rays is made once and goes through all of them, by turns, so that what is timed is
// the tracing of the same rays. Prints JSON, which bench/device_paths.py makes tables of.
//
// A backend is what builder_comparison.hpp says.
#pragma once

#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clocks.hpp"
#include "cuda/run.hpp"
#include "mesh_reader.hpp"
#include "path_rays.hpp"
#include "stage_time.hpp"
#include "timing.hpp"
#include "umbel/cuda_trace.hpp"

namespace bench {

namespace cuda = umbel::cuda;
namespace bvh = umbel::bvh;
using umbel::Mesh;

/// What is measured of a scene.
struct PathSettings {
  std::string name;
  std::vector<PathCamera> cameras;
  std::vector<std::string> builders{"sweep", "lbvh",  "hlbvh",       "atrbvh",
                                    "ploc",  "hploc", "kmeans 2016", "kmeans"};
  bvh::KmeansConfig kmeans;
  uint32_t samples = 128;  ///< a pixel
  uint32_t pass = 8;       ///< samples that are traced at a time
  int runs = 5;            ///< of a build, in the median
  double seconds = 1e9;    ///< no pass begins later
};

inline cuda::DeviceBvhConfig builder_of(const std::string& name, const PathSettings& settings) {
  const bool as_published = name == "kmeans 2016";
  cuda::DeviceBvhConfig config = cuda::device_builder_preset(as_published ? "kmeans" : name);
  if (config.builder == cuda::DeviceBuilder::kKmeans && (as_published || name == "kmeans"))
    config.kmeans = settings.kmeans;
  if (as_published) config.kmeans.forwarded_clusters = 1;
  return config;
}

template <typename Backend>
class PathTracing {
 public:
  PathTracing(Backend& backend, const Mesh& mesh, const PathSettings& settings)
      : backend_(backend),
        settings_(settings),
        positions_(mesh.positions.data(), mesh.positions.size()),
        triangles_(mesh.triangles.data(), mesh.triangles.size()),
        triangle_count_(static_cast<uint32_t>(mesh.triangles.size())),
        extent_(extent_of(mesh)),
        capacity_(capacity_of(settings)),
        rays_(capacity_),
        shadow_rays_(capacity_),
        t_(capacity_),
        primitives_(capacity_),
        any_(capacity_),
        kept_(capacity_),
        hits_(capacity_),
        vertices_(capacity_),
        count_(1),
        digest_(1),
        reach_(1) {}

  /// Builds, traces, and prints.
  void run() {
    for (const std::string& name : settings_.builders) build(name);
    for (uint32_t first = 0; first < settings_.samples; first += settings_.pass) {
      if (first > 0 && seconds() > settings_.seconds) break;
      const uint32_t samples = std::min(settings_.pass, settings_.samples - first);
      for (size_t view = 0; view < settings_.cameras.size(); ++view)
        trace_view(view, samples, first);
      samples_done_ += samples;
    }
    print();
  }

 private:
  template <typename T>
  using Array = typename Backend::template Array<T>;

  struct Traced {
    uint64_t nearest = 0, shadows = 0;  ///< rays
    double nearest_ms = 0, shadows_ms = 0;
  };
  struct Tree {
    std::string name;
    Array<bvh::CompactNode> nodes;
    Array<bvh::CompactTriangle> leaves;
    Array<bvh::CompactInfo> info;
    std::vector<StageTime> stages{};
    size_t scratch_bytes = 0;
    std::vector<Traced> views;

    Tree(std::string builder, uint32_t references, size_t view_count)
        : name(std::move(builder)),
          nodes(bvh::compact_node_capacity(references)),
          leaves(references),
          info(1),
          views(view_count) {}
    cuda::DeviceBvh on_device() const { return {nodes.data(), leaves.data(), info.data()}; }
  };

  static double extent_of(const Mesh& mesh) {
    float most = 0;
    for (const Vec3& p : mesh.positions)
      most = std::max({most, std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
    return std::max(static_cast<double>(most), 1e-30);
  }
  static size_t capacity_of(const PathSettings& settings) {
    size_t most = 0;
    for (const PathCamera& camera : settings.cameras)
      most = std::max(most, size_t{camera.width} * camera.height);
    return most * std::min(settings.pass, settings.samples);
  }
  cuda::MeshCorners corners() const {
    return {{reinterpret_cast<const char*>(positions_.data()), sizeof(Vec3)}, triangles_.data()};
  }

  double seconds() const { return wall_seconds() - begun_; }

  /// Runs work(executor) with the scratch memory that it needs.
  template <typename Work>
  void run_work(const Work& work) {
    size_t bytes = 0;
    cuda::run(nullptr, bytes, backend_.stream(), count_.data(), work);
    cuda::run(scratch(bytes), bytes, backend_.stream(), count_.data(), work);
  }
  void* scratch(size_t bytes) {
    if (!scratch_ || scratch_bytes_ < bytes) {
      scratch_.reset();
      scratch_.emplace(bytes);
      scratch_bytes_ = bytes;
    }
    return scratch_->data();
  }

  void build(const std::string& name) {
    constexpr uint32_t kLarge = 2000000;  // of larger ones the sweep runs once
    const cuda::DeviceBvhConfig config = builder_of(name, settings_);
    trees_.push_back(std::make_unique<Tree>(name, cuda::device_references(triangle_count_, config),
                                            settings_.cameras.size()));
    Tree& tree = *trees_.back();
    const auto build = [&](void* memory, const auto& stage) {
      cuda::run(memory, tree.scratch_bytes, backend_.stream(), count_.data(), [&](auto& exec) {
        cuda::build_compact(exec, corners(), nullptr, triangle_count_, config,
                            {tree.nodes.data(), tree.leaves.data(), tree.info.data()}, stage);
      });
    };
    build(nullptr, backend_.no_stages());
    const Array<unsigned char> memory(tree.scratch_bytes);
    const int runs = name == "sweep" && triangle_count_ > kLarge ? 1 : settings_.runs;
    tree.stages =
        backend_.time_stages([&](const auto& stage) { build(memory.data(), stage); }, runs);
    std::fprintf(stderr, "%s: built %s, %.0f s\n", settings_.name.c_str(), name.c_str(), seconds());
  }

  void trace_view(size_t view, uint32_t samples, uint32_t first_sample) {
    constexpr uint32_t kRouletteFrom = 2, kMostBounces = 32;
    constexpr double kAlbedo = 0.75, kSky = 0.002;
    const PathCamera& camera = settings_.cameras[view];
    const auto seed = [&](uint32_t bounce, uint32_t purpose) {
      return umbel::mix64(umbel::mix64(uint64_t{view} << 32 | first_sample) ^
                          (uint64_t{bounce} << 32 | purpose));
    };
    const size_t paths = size_t{camera.width} * camera.height * samples;
    auto count = static_cast<uint32_t>(paths);
    paths_ += paths;
    run_work([&](auto& exec) { camera_rays(exec, camera, samples, seed(0, 0), rays_.data()); });
    bool has_lamp = false;
    for (uint32_t bounce = 0; bounce <= kMostBounces; ++bounce) {
      trace_nearest(view, count);
      const uint32_t hits = counted([&](auto& exec) {
        select_hits(exec, primitives_.data(), count, hits_.data(), count_.data());
      });
      if (bounce == 0) has_lamp = hits > (1 - kSky) * count;
      if (hits == 0) return;
      run_work([&](auto& exec) {
        path_vertices(exec, corners(), extent_, rays_.data(), {t_.data(), primitives_.data()},
                      hits_.data(), hits, vertices_.data());
      });
      double reach = 0;
      if (has_lamp) {
        run_work([&](auto& exec) {
          reach_from(exec, camera.position, vertices_.data(), hits, reach_.data());
        });
        reach = backend_.read(reach_.data());
      }
      for (const Light light : {Light::kSun, Light::kSky})
        trace_shadows(view,
                      ShadowRays{vertices_.data(), has_lamp ? Light::kLamp : light, camera.position,
                                 reach, seed(bounce, 1 + static_cast<uint32_t>(light))},
                      hits);
      const BouncedRays bounced{vertices_.data(), bounce < kRouletteFrom ? 1.0 : kAlbedo,
                                seed(bounce, 3)};
      count = make(bounced, hits, rays_);
      if (count == 0) return;
    }
  }

  /// Runs what counts, and reads that.
  template <typename Work>
  uint32_t counted(const Work& work) {
    run_work(work);
    return backend_.read(count_.data());
  }
  template <typename Rays>
  uint32_t make(const Rays& rays, uint32_t places, const Array<Ray>& out) {
    const uint32_t count =
        counted([&](auto& exec) { select_rays(exec, rays, places, kept_.data(), count_.data()); });
    run_work([&](auto& exec) { make_rays(exec, rays, kept_.data(), count, out.data()); });
    return count;
  }

  void trace_nearest(size_t view, uint32_t count) {
    const cuda::DeviceHits out{t_.data(), primitives_.data(), nullptr};
    const auto trace = [&](const Tree& tree, void* memory, size_t& bytes) {
      cuda::intersect_rays(memory, bytes, tree.on_device(), given(rays_, count), out,
                           backend_.stream());
    };
    each_tree(count, false, trace, [&](Tree& tree, double milliseconds) {
      tree.views[view].nearest += count;
      tree.views[view].nearest_ms += milliseconds;
    });
  }
  void trace_shadows(size_t view, const ShadowRays& shadows, uint32_t places) {
    const uint32_t count = make(shadows, places, shadow_rays_);
    if (count == 0) return;
    const auto trace = [&](const Tree& tree, void* memory, size_t& bytes) {
      cuda::occluded_rays(memory, bytes, tree.on_device(), given(shadow_rays_, count), any_.data(),
                          backend_.stream());
    };
    each_tree(count, true, trace, [&](Tree& tree, double milliseconds) {
      tree.views[view].shadows += count;
      tree.views[view].shadows_ms += milliseconds;
    });
  }
  static cuda::DeviceRays given(const Array<Ray>& rays, uint32_t count) {
    cuda::DeviceRays found;
    found.origins = &rays.data()->origin;
    found.directions = &rays.data()->direction;
    found.origin_stride = found.direction_stride = found.interval_stride = sizeof(Ray);
    found.t_min = &rays.data()->t_min;
    found.t_max = &rays.data()->t_max;
    found.count = count;
    return found;
  }

  /// Traces a batch through all trees, by turns that begin with another one each time. All trees
  /// must have the same hits.
  template <typename Trace, typename Add>
  void each_tree(uint32_t count, bool any, const Trace& trace, const Add& add) {
    std::optional<uint64_t> same;
    for (size_t turn = 0; turn < trees_.size(); ++turn) {
      Tree& tree = *trees_[(turn + batches_) % trees_.size()];
      size_t bytes = 0;
      trace(tree, nullptr, bytes);
      void* const memory = scratch(bytes);
      // The first time of a kernel takes longer.
      if (!std::exchange(is_warm_[any ? 1 : 0], true)) trace(tree, memory, bytes);
      add(tree, backend_.time_once([&] { trace(tree, memory, bytes); }));
      run_work([&](auto& exec) {
        digest_of_hits(exec, {t_.data(), primitives_.data()}, any ? any_.data() : nullptr, count,
                       digest_.data());
      });
      const uint64_t digest = backend_.read(digest_.data());
      if (same.value_or(digest) != digest)
        throw std::runtime_error(settings_.name + ": " + tree.name +
                                 " has other hits than the tree before it");
      same = digest;
    }
    ++batches_;
  }

  void print() {
    std::printf("{\"device\": \"%s\", \"scene\": \"%s\", \"triangles\": %u, \"runs\": %d,\n",
                backend_.name().c_str(), settings_.name.c_str(), triangle_count_, settings_.runs);
    std::printf(" \"kmeans\": [%u, %u, %u], \"resolution\": [%u, %u], \"samples\": %u,\n",
                settings_.kmeans.clusters, settings_.kmeans.candidates, settings_.kmeans.iterations,
                settings_.cameras[0].width, settings_.cameras[0].height, samples_done_);
    std::printf(" \"samples_wanted\": %u, \"paths\": %llu, \"seconds\": %.1f, \"builders\": [",
                settings_.samples, static_cast<unsigned long long>(paths_), seconds());
    const char* separator = "\n";
    for (const auto& tree : trees_) {
      const bvh::CompactInfo info = backend_.read(tree->info.data());
      std::printf(
          "%s  {\"builder\": \"%s\", \"sah\": %.6g, \"nodes\": %u, \"scratch_bytes\": %s,\n",
          std::exchange(separator, ",\n"), tree->name.c_str(), static_cast<double>(info.sah_cost),
          info.nodes,
          Backend::kTakesScratch ? std::to_string(tree->scratch_bytes).c_str() : "null");
      std::printf("   \"stages\": {");
      for (size_t i = 0; i < tree->stages.size(); ++i)
        std::printf("%s\"%s\": %.6f", i > 0 ? ", " : "", tree->stages[i].name.c_str(),
                    tree->stages[i].milliseconds);
      std::printf("},\n   \"views\": [");
      for (size_t i = 0; i < tree->views.size(); ++i) {
        const Traced& view = tree->views[i];
        std::printf(
            "%s{\"nearest\": %llu, \"shadows\": %llu, \"nearest_ms\": %.6f, \"shadows_ms\": %.6f}",
            i > 0 ? ", " : "", static_cast<unsigned long long>(view.nearest),
            static_cast<unsigned long long>(view.shadows), view.nearest_ms, view.shadows_ms);
      }
      std::printf("]}");
    }
    std::printf("\n ]}\n");
  }

  Backend& backend_;
  const PathSettings& settings_;
  double begun_ = wall_seconds();
  Array<Vec3> positions_;
  Array<Triangle> triangles_;
  uint32_t triangle_count_;
  double extent_;
  size_t capacity_;  ///< rays of a batch, at most
  Array<Ray> rays_, shadow_rays_;
  Array<float> t_;
  Array<uint32_t> primitives_;
  Array<uint8_t> any_;
  Array<uint32_t> kept_, hits_;
  Array<PathVertex> vertices_;
  Array<uint32_t> count_;
  Array<uint64_t> digest_;
  Array<double> reach_;
  std::optional<Array<unsigned char>> scratch_;
  size_t scratch_bytes_ = 0;
  std::vector<std::unique_ptr<Tree>> trees_;
  std::array<bool, 2> is_warm_{};
  size_t batches_ = 0;
  uint64_t paths_ = 0;
  uint32_t samples_done_ = 0;
};

/// "1.5,2,3" as numbers, exactly so many.
inline std::vector<double> numbers_in(const std::string& text, size_t count) {
  std::vector<double> found;
  const char* at = text.c_str();
  for (char* end = nullptr;; at = end + 1) {
    found.push_back(std::strtod(at, &end));
    if (end == at || *end != ',') break;
  }
  if (found.size() != count)
    throw std::runtime_error("\"" + text + "\" is not " + std::to_string(count) + " numbers");
  return found;
}

inline PathSettings path_settings(const Arguments& arguments) {
  const auto last = [&](const char* name, const std::string& otherwise) {
    const std::vector<std::string> values = arguments.all(name);
    return values.empty() ? otherwise : values.back();
  };
  PathSettings settings;
  const std::vector<double> size = numbers_in(last("size", "1024,768"), 2);
  for (const double side : size)
    if (!(side >= 16 && side <= 16384) || static_cast<uint32_t>(side) % 16 != 0)
      throw std::runtime_error("--size must be multiples of 16");
  for (const std::string& text : arguments.all("camera")) {
    const std::vector<double> c = numbers_in(text, 10);
    settings.cameras.push_back({{c[0], c[1], c[2]},
                                {c[3], c[4], c[5]},
                                {c[6], c[7], c[8]},
                                c[9],
                                static_cast<uint32_t>(size[0]),
                                static_cast<uint32_t>(size[1])});
  }
  const std::vector<double> kmeans = numbers_in(last("kmeans", "8,5,2"), 3);
  settings.kmeans.clusters = static_cast<uint32_t>(kmeans[0]);
  settings.kmeans.candidates = static_cast<uint32_t>(kmeans[1]);
  settings.kmeans.iterations = static_cast<uint32_t>(kmeans[2]);
  settings.samples = static_cast<uint32_t>(arguments.number("samples", 128, 1));
  settings.pass = static_cast<uint32_t>(arguments.number("pass", 8, 1));
  settings.runs = arguments.number("runs", 5, 1);
  settings.seconds = arguments.number("seconds", 1000000, 0);
  if (const auto builders = arguments.all("builder"); !builders.empty())
    settings.builders = builders;
  for (const std::string& name : settings.builders) builder_of(name, settings);
  if (arguments.meshes().size() != 1 || settings.cameras.empty())
    throw std::runtime_error("needs a mesh and a --camera for each picture");
  const std::string file = file_name(arguments.meshes()[0]);
  settings.name = last("name", file.substr(0, file.rfind('.')));
  return settings;
}

/// Traces what the arguments say: [--name NAME] [--size W,H] [--samples N] [--pass N] [--runs N]
/// [--seconds N] [--kmeans K,P,I] [--builder NAME]... --camera X,Y,Z,X,Y,Z,X,Y,Z,RADIANS... MESH
template <typename Backend>
void trace_paths(Backend& backend, const Arguments& arguments) {
  const PathSettings settings = path_settings(arguments);
  const Mesh mesh = read_mesh(arguments.meshes()[0]);
  if (mesh.triangles.empty()) throw std::runtime_error("the mesh has no triangles");
  PathTracing<Backend>(backend, mesh, settings).run();
}

}  // namespace bench
