// Builders of hierarchies on the device: what each stage of a build takes, what the tree costs by
// SAH, and how fast rays pass through it. Prints JSON, which `umbel bench bvh --device cuda` makes
// tables and charts of.
//
//   cuda_bvh_bench [--runs N] [--builder NAME]... MESH.ply...
//
// Rays are those of three pictures of 512 x 512 pixels, and of one diffuse bounce from what they
// hit.
#include <cuda_runtime.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "cuda/run.cuh"
// What is above comes first.
#include "cuda/build_bvh.hpp"
#include "picture_rays.hpp"
#include "ply_reader.hpp"
#include "umbel/cuda_trace.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel {
namespace {

using cuda::check;

constexpr uint32_t kSize = 512;
/// The sweep of larger meshes takes longer than all the rest.
constexpr uint32_t kMostSwept = 3000000;

template <typename T>
class Device {
 public:
  explicit Device(size_t size) {
    check(cudaMalloc(&memory_, std::max<size_t>(size, 1) * sizeof(T)), "allocating");
  }
  Device(const T* values, size_t size) : Device(size) {
    check(cudaMemcpy(memory_, values, size * sizeof(T), cudaMemcpyHostToDevice), "copying");
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  ~Device() { cudaFree(memory_); }
  T* data() const { return memory_; }

 private:
  T* memory_ = nullptr;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

class Event {
 public:
  Event() { check(cudaEventCreate(&event_), "making an event"); }
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  ~Event() { cudaEventDestroy(event_); }
  void record(cudaStream_t stream) { check(cudaEventRecord(event_, stream), "recording"); }
  double milliseconds_since(const Event& first) const {
    check(cudaEventSynchronize(event_), "waiting");
    float milliseconds = 0;
    check(cudaEventElapsedTime(&milliseconds, first.event_, event_), "timing");
    return milliseconds;
  }

 private:
  cudaEvent_t event_ = nullptr;
};

/// Milliseconds of a call of the library, with its scratch memory.
double time_call(const std::function<void(void*, size_t&, cudaStream_t)>& call, int runs,
                 cudaStream_t stream) {
  size_t bytes = 0;
  call(nullptr, bytes, stream);
  const Device<unsigned char> scratch(bytes);
  std::vector<double> times;
  Event begin, end;
  for (int run = -1; run < runs; ++run) {
    begin.record(stream);
    call(scratch.data(), bytes, stream);
    end.record(stream);
    const double time = end.milliseconds_since(begin);
    if (run >= 0) times.push_back(time);
  }
  return median(times);
}

struct StageTime {
  std::string name;
  double milliseconds;
};

/// Marks the end of each stage in the stream.
struct StageEvents {
  static constexpr size_t kMost = 8;

  cudaStream_t stream;
  std::vector<Event>* events;
  std::vector<std::string>* names;

  void operator()(const char* name) const {
    names->push_back(name);
    if (names->size() < kMost) (*events)[names->size()].record(stream);
  }
};

/// A mesh and a tree over it on the device.
class Scene {
 public:
  explicit Scene(const Mesh& mesh)
      : positions_(mesh.positions.data(), mesh.positions.size()),
        triangles_(mesh.triangles.data(), mesh.triangles.size()),
        n_(uint32_t(mesh.triangles.size())),
        nodes_(bvh::compact_node_capacity(n_)),
        leaves_(n_),
        info_(1) {}

  cuda::DeviceBvh tree() const { return {nodes_.data(), leaves_.data(), info_.data()}; }

  /// Medians of the stages, and how much scratch memory they take.
  std::vector<StageTime> build(const cuda::DeviceBvhConfig& config, int runs, cudaStream_t stream,
                               size_t& scratch_bytes) const {
    std::vector<Event> events(StageEvents::kMost);
    std::vector<std::string> names;
    const auto work = [&](auto& exec) {
      names.clear();
      cuda::build_compact(exec, corners(), nullptr, n_, config,
                          {nodes_.data(), leaves_.data(), info_.data()},
                          StageEvents{stream, &events, &names});
    };
    cuda::run(nullptr, scratch_bytes, stream, work);
    const Device<unsigned char> scratch(scratch_bytes);
    std::vector<std::vector<double>> times(names.size());
    for (int run = -1; run < runs; ++run) {
      events[0].record(stream);
      cuda::run(scratch.data(), scratch_bytes, stream, work);
      for (size_t i = 0; i < names.size(); ++i) {
        const double time = events[i + 1].milliseconds_since(events[i]);
        if (run >= 0) times[i].push_back(time);
      }
    }
    std::vector<StageTime> stages;
    for (size_t i = 0; i < names.size(); ++i) stages.push_back({names[i], median(times[i])});
    return stages;
  }
  double refit(const cuda::DeviceBvhConfig& config, int runs, cudaStream_t stream) const {
    const cuda::DeviceMesh mesh{positions_.data(), sizeof(Vec3),
                                reinterpret_cast<const uint32_t*>(triangles_.data()), nullptr, n_};
    return time_call(
        [&](void* scratch, size_t& bytes, cudaStream_t s) {
          cuda::refit_bvh(scratch, bytes, mesh, config, tree(), s);
        },
        runs, stream);
  }
  bvh::CompactInfo info() const {
    bvh::CompactInfo info{};
    check(cudaMemcpy(&info, info_.data(), sizeof info, cudaMemcpyDeviceToHost), "copying");
    return info;
  }

 private:
  cuda::MeshCorners corners() const {
    return {{reinterpret_cast<const char*>(positions_.data()), sizeof(Vec3)}, triangles_.data()};
  }

  Device<Vec3> positions_;
  Device<Triangle> triangles_;
  uint32_t n_;
  Device<bvh::CompactNode> nodes_;
  Device<bvh::CompactTriangle> leaves_;
  Device<bvh::CompactInfo> info_;
};

/// Rays on the device, and where they hit.
class Rays {
 public:
  explicit Rays(const std::vector<Ray>& rays)
      : rays_(rays.data(), rays.size()),
        t_(rays.size()),
        primitives_(rays.size()),
        count_(rays.size()) {}

  size_t size() const { return count_; }
  double trace(const cuda::DeviceBvh& tree, int runs, cudaStream_t stream) const {
    cuda::DeviceRays rays;
    rays.origins = &rays_.data()->origin;
    rays.directions = &rays_.data()->direction;
    rays.origin_stride = rays.direction_stride = sizeof(Ray);
    rays.count = count_;
    const cuda::DeviceHits hits{t_.data(), primitives_.data(), nullptr};
    return time_call(
        [&](void* scratch, size_t& bytes, cudaStream_t s) {
          cuda::intersect_rays(scratch, bytes, tree, rays, hits, s);
        },
        runs, stream);
  }

 private:
  Device<Ray> rays_;
  Device<float> t_;
  Device<uint32_t> primitives_;
  size_t count_;
};

void measure(const std::string& name, const Mesh& mesh, const std::vector<std::string>& builders,
             int runs, cudaStream_t stream) {
  const trace::Scene pictured = trace::Scene::build(mesh.view());
  std::vector<Ray> primary;
  for (const float azimuth : {30.0f, 150.0f, 270.0f}) {
    trace::Viewpoint viewpoint;
    viewpoint.azimuth = azimuth;
    const std::vector<Ray> rays =
        bench::camera_rays(trace::auto_camera(pictured, kSize, kSize, viewpoint), kSize, 1);
    primary.insert(primary.end(), rays.begin(), rays.end());
  }
  const Rays first(primary), second(bench::bounces(mesh, primary, pictured.structure()));
  const Scene scene(mesh);
  printf(
      "  {\"scene\": \"%s\", \"triangles\": %zu, \"primary_rays\": %zu, \"bounce_rays\": %zu,\n"
      "   \"builders\": [\n",
      name.c_str(), mesh.triangles.size(), first.size(), second.size());
  bool follows = false;
  for (const std::string& builder : builders) {
    if (builder == "sweep" && mesh.triangles.size() > kMostSwept) continue;
    const cuda::DeviceBvhConfig config = cuda::device_builder_preset(builder);
    size_t scratch = 0;
    const std::vector<StageTime> stages =
        scene.build(config, builder == "sweep" ? 3 : runs, stream, scratch);
    const bvh::CompactInfo info = scene.info();
    printf(
        "%s    {\"builder\": \"%s\", \"sah\": %.6g, \"nodes\": %u, \"scratch_bytes\": %zu, "
        "\"stages\": {",
        follows ? ",\n" : "", builder.c_str(), double(info.sah_cost), info.nodes, scratch);
    for (size_t i = 0; i < stages.size(); ++i)
      printf("%s\"%s\": %.6f", i > 0 ? ", " : "", stages[i].name.c_str(), stages[i].milliseconds);
    const double primary_ms = first.trace(scene.tree(), runs, stream);
    const double bounce_ms = second.trace(scene.tree(), runs, stream);
    printf("}, \"refit_ms\": %.6f, \"primary_ms\": %.6f, \"bounce_ms\": %.6f}",
           scene.refit(config, runs, stream), primary_ms, bounce_ms);
    fflush(stdout);
    follows = true;
  }
  printf("\n   ]}");
}

int run_all(int argc, char** argv) {
  int runs = 20;
  std::vector<std::string> meshes, builders;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--runs" && i + 1 < argc)
      runs = std::max(1, atoi(argv[++i]));
    else if (argument == "--builder" && i + 1 < argc)
      builders.push_back(argv[++i]);
    else
      meshes.push_back(argument);
  }
  if (builders.empty())
    builders = {"lbvh",      "hlbvh",     "atrbvh",    "ploc",      "hploc", "kmeans-q1",
                "kmeans-q2", "kmeans-q3", "kmeans-q4", "kmeans-q5", "sweep"};
  for (const std::string& builder : builders) cuda::device_builder_preset(builder);
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
    fprintf(stderr, "cuda_bvh_bench: CUDA finds no device\n");
    return 3;
  }
  cudaDeviceProp device;
  check(cudaGetDeviceProperties(&device, 0), "asking for the device");
  cudaStream_t stream;
  check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "making a stream");
  printf("{\"device\": \"%s\", \"runs\": %d, \"scenes\": [\n", device.name, runs);
  for (size_t i = 0; i < meshes.size(); ++i) {
    if (i > 0) printf(",\n");
    const std::string file = meshes[i].substr(meshes[i].find_last_of('/') + 1);
    measure(file.substr(0, file.find_last_of('.')), bench::read_ply(meshes[i]), builders, runs,
            stream);
  }
  printf("\n]}\n");
  return 0;
}

}  // namespace
}  // namespace umbel

int main(int argc, char** argv) try {
  return umbel::run_all(argc, argv);
} catch (const std::exception& error) {
  fprintf(stderr, "cuda_bvh_bench: %s\n", error.what());
  return 1;
}
