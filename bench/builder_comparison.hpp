// Device builders of hierarchies beside each other, on a device or with the same code on the
// processor: what each stage of a build takes, what the tree costs by SAH, and how fast rays pass
// through it. Prints JSON, which umbel/bench/bvh/cuda.py makes tables and charts of.
//
// The file that includes this includes what defines umbel::cuda::run before, and gives a class
//
//   struct Backend {
//     static constexpr bool kTakesScratch;  // or memory comes from elsewhere
//     template <typename T> class Array;  // of a device: Array(size), Array(values, size), data()
//     std::string name() const;
//     cuda::Stream stream() const;
//     Stages no_stages() const;  // ignores what it is called with
//     /// Medians of what passes up to each call of `stage` in work(stage).
//     template <typename Work> std::vector<StageTime> time_stages(const Work& work, int runs);
//     /// Milliseconds of work().
//     template <typename Work> double time_once(const Work& work);
//     template <typename T> T read(const T* value);  // once all work before is done
//   };
#pragma once

#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "bvh/compressed/build_compact.hpp"
#include "cuda/run.hpp"
#include "mesh_reader.hpp"
#include "picture_rays.hpp"
#include "stage_time.hpp"
#include "timing.hpp"
#include "umbel/cuda_trace.hpp"
#include "umbel/triangle_bvh.hpp"

namespace bench {

namespace cuda = umbel::cuda;
namespace bvh = umbel::bvh;

template <typename Backend>
class BuilderComparison {
 public:
  static constexpr uint32_t kSize = 512;
  /// The sweep of larger meshes takes longer than all the rest.
  static constexpr uint32_t kMostSwept = 3000000;

  BuilderComparison(Backend& backend, int runs) : backend_(backend), runs_(runs) {}

  void begin() const {
    std::printf("{\"device\": \"%s\", \"runs\": %d, \"scenes\": [\n", backend_.name().c_str(),
                runs_);
  }
  static void end() { std::printf("\n]}\n"); }

  void measure(const std::string& name, const Mesh& mesh,
               const std::vector<std::string>& builders) {
    const trace::Scene pictured = trace::Scene::build(mesh.view());
    std::vector<Ray> primary;
    for (const float azimuth : {30.0f, 150.0f, 270.0f}) {
      trace::Viewpoint viewpoint;
      viewpoint.azimuth = azimuth;
      const std::vector<Ray> rays =
          camera_rays(trace::auto_camera(pictured, kSize, kSize, viewpoint), kSize, 1);
      primary.insert(primary.end(), rays.begin(), rays.end());
    }
    const Rays first(primary), second(bounces(mesh, primary, pictured.structure()));
    const Scene scene(mesh);
    std::printf(
        "%s  {\"scene\": \"%s\", \"triangles\": %zu, \"primary_rays\": %zu, \"bounce_rays\": %zu,\n"
        "   \"builders\": [\n",
        std::exchange(follows_, true) ? ",\n" : "", name.c_str(), mesh.triangles.size(),
        first.count, second.count);
    bool follows = false;
    for (const std::string& builder : builders)
      if (builder != "sweep" || mesh.triangles.size() <= kMostSwept) {
        if (std::exchange(follows, true)) std::printf(",\n");
        measure(scene, first, second, builder);
      }
    std::printf("\n   ]}");
  }

 private:
  template <typename T>
  using Array = typename Backend::template Array<T>;

  /// Rays, and where they hit.
  struct Rays {
    explicit Rays(const std::vector<Ray>& given)
        : rays(given.data(), given.size()),
          t(given.size()),
          primitives(given.size()),
          count(given.size()) {}

    Array<Ray> rays;
    Array<float> t;
    Array<uint32_t> primitives;
    size_t count;
  };
  /// A mesh and a tree over it.
  struct Scene {
    explicit Scene(const Mesh& mesh)
        : positions(mesh.positions.data(), mesh.positions.size()),
          triangles(mesh.triangles.data(), mesh.triangles.size()),
          n(static_cast<uint32_t>(mesh.triangles.size())),
          nodes(bvh::compact_node_capacity(n)),
          leaves(n),
          info(1) {}

    cuda::DeviceBvh tree() const { return {nodes.data(), leaves.data(), info.data()}; }
    cuda::DeviceMesh mesh() const {
      return {positions.data(), sizeof(Vec3), reinterpret_cast<const uint32_t*>(triangles.data()),
              nullptr, n};
    }
    cuda::MeshCorners corners() const {
      return {{reinterpret_cast<const char*>(positions.data()), sizeof(Vec3)}, triangles.data()};
    }

    Array<Vec3> positions;
    Array<Triangle> triangles;
    uint32_t n;
    Array<bvh::CompactNode> nodes;
    Array<bvh::CompactTriangle> leaves;
    Array<bvh::CompactInfo> info;
  };

  void measure(const Scene& scene, const Rays& first, const Rays& second,
               const std::string& builder) {
    const cuda::DeviceBvhConfig config = cuda::device_builder_preset(builder);
    size_t scratch_bytes = 0;
    const std::vector<StageTime> stages =
        build(scene, config, builder == "sweep" ? std::min(runs_, 3) : runs_, scratch_bytes);
    const bvh::CompactInfo info = backend_.read(scene.info.data());
    std::printf(
        "    {\"builder\": \"%s\", \"sah\": %.6g, \"nodes\": %u, \"scratch_bytes\": %s, "
        "\"stages\": {",
        builder.c_str(), static_cast<double>(info.sah_cost), info.nodes,
        Backend::kTakesScratch ? std::to_string(scratch_bytes).c_str() : "null");
    for (size_t i = 0; i < stages.size(); ++i)
      std::printf("%s\"%s\": %.6f", i > 0 ? ", " : "", stages[i].name.c_str(),
                  stages[i].milliseconds);
    const double primary_ms = trace(scene, first), bounce_ms = trace(scene, second);
    const double refit_ms = time_call([&](void* scratch, size_t& bytes, cuda::Stream stream) {
      cuda::refit_bvh(scratch, bytes, scene.mesh(), config, scene.tree(), stream);
    });
    std::printf("}, \"refit_ms\": %.6f, \"primary_ms\": %.6f, \"bounce_ms\": %.6f}", refit_ms,
                primary_ms, bounce_ms);
    std::fflush(stdout);
  }

  std::vector<StageTime> build(const Scene& scene, const cuda::DeviceBvhConfig& config, int runs,
                               size_t& scratch_bytes) {
    const auto build = [&](void* scratch, const auto& stage) {
      cuda::run(scratch, scratch_bytes, backend_.stream(), scene.nodes.data(), [&](auto& exec) {
        cuda::build_compact(exec, scene.corners(), nullptr, scene.n, config,
                            {scene.nodes.data(), scene.leaves.data(), scene.info.data()}, stage);
      });
    };
    build(nullptr, backend_.no_stages());
    const Array<unsigned char> scratch(scratch_bytes);
    return backend_.time_stages([&](const auto& stage) { build(scratch.data(), stage); }, runs);
  }
  double trace(const Scene& scene, const Rays& given) {
    cuda::DeviceRays rays;
    rays.origins = &given.rays.data()->origin;
    rays.directions = &given.rays.data()->direction;
    rays.origin_stride = rays.direction_stride = sizeof(Ray);
    rays.count = given.count;
    const cuda::DeviceHits hits{given.t.data(), given.primitives.data(), nullptr};
    return time_call([&](void* scratch, size_t& bytes, cuda::Stream stream) {
      cuda::intersect_rays(scratch, bytes, scene.tree(), rays, hits, stream);
    });
  }
  /// Milliseconds of a call of the library, with its scratch memory.
  template <typename Call>
  double time_call(const Call& call) {
    size_t bytes = 0;
    call(nullptr, bytes, backend_.stream());
    const Array<unsigned char> scratch(bytes);
    const auto work = [&](const auto& stage) {
      call(scratch.data(), bytes, backend_.stream());
      stage("call");
    };
    return backend_.time_stages(work, runs_)[0].milliseconds;
  }

  Backend& backend_;
  int runs_;
  bool follows_ = false;
};

/// Measures what the arguments say: [--runs N] [--builder NAME]... [--large MILLIONS] MESH...
template <typename Backend>
void compare_builders(Backend& backend, const Arguments& arguments) {
  std::vector<std::string> builders = arguments.all("builder");
  if (builders.empty())
    builders = {"lbvh",      "hlbvh",     "atrbvh",    "ploc",      "hploc", "kmeans-q1",
                "kmeans-q2", "kmeans-q3", "kmeans-q4", "kmeans-q5", "sweep"};
  for (const std::string& builder : builders) cuda::device_builder_preset(builder);
  BuilderComparison<Backend> comparison(backend, arguments.number("runs", 20, 1));
  comparison.begin();
  for (const std::string& path : arguments.meshes()) {
    const std::string file = file_name(path);
    comparison.measure(file.substr(0, file.rfind('.')), read_mesh(path), builders);
  }
  // How the fastest ones scale.
  if (const int millions = arguments.number("large", 0, 0); millions > 0) {
    const auto side = static_cast<uint32_t>(std::sqrt(5e5 * millions));
    comparison.measure("terrain_" + std::to_string(millions) + "M",
                       umbel::shapes::terrain(side, side, 1), {"lbvh", "hploc"});
  }
  comparison.end();
}

}  // namespace bench
