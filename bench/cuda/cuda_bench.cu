// Clusters on the device: builds, refits and partial rebuilds beside what their memory traffic
// alone would take, beside a plain version made of thrust::stable_sort_by_key and straightforward
// kernels, and beside the same algorithms on one core of the processor, which is all there is to
// measure without a device. Prints Markdown.
//
//   cuda_bench [--runs N] [--large MILLIONS] MESH...
#include <cuda_runtime.h>
#include <thrust/device_vector.h>
#include <thrust/execution_policy.h>
#include <thrust/reduce.h>
#include <thrust/sequence.h>
#include <thrust/sort.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/math.hpp"
#include "base/morton.hpp"
#include "mesh_reader.hpp"
#include "timing.cuh"
#include "umbel/cluster.hpp"
#include "umbel/cuda_clusters.hpp"

namespace umbel {
namespace {

// ---- the plain version
// ---------------------------------------------------------------------------

__global__ void box_each(const Vec3* positions, const Triangle* triangles, uint32_t n,
                         Aabb* boxes) {
  const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= n) return;
  Aabb box;
  for (int k = 0; k < 3; ++k) extend(box, positions[triangles[i][k]]);
  boxes[i] = box;
}
__global__ void code_each(const Aabb* boxes, uint32_t n, Aabb all, uint32_t* codes) {
  const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= n) return;
  const MortonGrid grid = MortonGrid::around({all.min + all.min, all.max + all.max}, 10);
  codes[i] = grid.code<uint32_t>(boxes[i]);
}
__global__ void gather_each(const Triangle* triangles, const uint32_t* items, uint32_t n,
                            Triangle* out) {
  const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < n) out[i] = triangles[items[i]];
}
__global__ void box_clusters(const Aabb* boxes, const uint32_t* items, uint32_t n, Aabb* out) {
  const uint32_t c = blockIdx.x * blockDim.x + threadIdx.x;
  if (c * 128 >= n) return;
  Aabb box;
  for (uint32_t i = c * 128; i < ::min(c * 128 + 128, n); ++i) extend(box, boxes[items[i]]);
  out[c] = box;
}

struct Unite {
  __host__ __device__ Aabb operator()(Aabb a, const Aabb& b) const {
    extend(a, b);
    return a;
  }
};

struct Plain {
  const Vec3* positions;
  const Triangle* triangles;
  uint32_t n;
  Device<Aabb> boxes, cluster_boxes;
  Device<uint32_t> codes, items;
  Device<Triangle> out;

  Plain(const Vec3* p, const Triangle* t, uint32_t count)
      : positions(p),
        triangles(t),
        n(count),
        boxes(count),
        cluster_boxes(count / 128 + 1),
        codes(count),
        items(count),
        out(count) {}

  void operator()(cudaStream_t stream) {
    const uint32_t blocks = (n + 255) / 256;
    const auto policy = thrust::cuda::par.on(stream);
    box_each<<<blocks, 256, 0, stream>>>(positions, triangles, n, boxes.data());
    const Aabb all = thrust::reduce(policy, boxes.data(), boxes.data() + n, Aabb{}, Unite{});
    code_each<<<blocks, 256, 0, stream>>>(boxes.data(), n, all, codes.data());
    thrust::sequence(policy, items.data(), items.data() + n);
    thrust::stable_sort_by_key(policy, codes.data(), codes.data() + n, items.data());
    gather_each<<<blocks, 256, 0, stream>>>(triangles, items.data(), n, out.data());
    box_clusters<<<(n / 128 + 256) / 256, 256, 0, stream>>>(boxes.data(), items.data(), n,
                                                            cluster_boxes.data());
    check(cudaGetLastError(), "the plain version");
  }
};

// ---- what is measured
// ----------------------------------------------------------------------------

/// Bytes that each step must move, each input read and each output written once a pass.
struct Traffic {
  double bounds, codes, sort, write;
  double morton() const { return bounds + codes + sort + write; }

  Traffic(double triangles, double vertices, double code_bits) {
    const double mesh = 12 * triangles + 12 * vertices, key = code_bits > 32 ? 8 : 4;
    const double passes = std::ceil(code_bits / 8);
    bounds = mesh;
    codes = mesh + (key + 4) * triangles;
    // A histogram of the keys, then read and written once a pass.
    sort = key * triangles + passes * 2 * (key + 4) * triangles;
    write = mesh + (4 + 12 + 4) * triangles + 24 * triangles / 128;
  }
};

double area_of_quality(const Mesh& mesh, const Clusters& clusters) {
  ClusterInput input;
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  input.boxes = boxes;
  return cluster_metrics(input, clusters, 128).surface_area_ratio;
}

void print_processor_head() {
  printf(
      "\n## One core of the processor\n\nMillions of triangles a second in processor time, medians "
      "of 5, with a new index buffer and boxes; area ratios. Refits measure too.\n\n"
      "| mesh | triangles | Morton | hybrid | refit | hybrid / Morton, time | area: Morton | "
      "hybrid | "
      "quality | hybrid / quality |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
}

void measure_processor(const std::string& name, const Mesh& mesh) {
  FrameClusterConfig by_runs;
  by_runs.method = FrameMethod::kMorton;
  const BuildOptions one{nullptr, 1};
  FrameClusterer morton(mesh.triangles, mesh.positions.size(), by_runs);
  FrameClusterer hybrid(mesh.triangles, mesh.positions.size(), {});
  const std::vector<double> ms = processor_milliseconds(
      {[&] { morton.build(mesh.positions, one); }, [&] { hybrid.build(mesh.positions, one); },
       [&] { hybrid.refit(mesh.positions, one); }},
      5);
  const double quality =
      area_of_quality(mesh, cluster_mesh(mesh.view(), cluster_preset("quality"), 0, one));
  const auto rate = [&](double milliseconds) {
    return double(mesh.triangles.size()) / milliseconds / 1e3;
  };
  const double areas[2] = {morton.area_growth().area_ratio, hybrid.area_growth().area_ratio};
  printf("| %s | %zu | %.1f | %.1f | %.0f | %.2f | %.2f | %.2f | %.2f | %.2f |\n", name.c_str(),
         mesh.triangles.size(), rate(ms[0]), rate(ms[1]), rate(ms[2]), ms[1] / ms[0], areas[0],
         areas[1], quality, areas[1] / quality);
  fflush(stdout);
}

struct Arrays {
  Device<uint32_t> items, indices, offsets, count;
  Device<Aabb> boxes;
  Device<uint64_t> now, at_build, total;

  Arrays(uint32_t n, uint32_t most)
      : items(n),
        indices(size_t(n) * 3),
        offsets(most + 1),
        count(1),
        boxes(most),
        now(most),
        at_build(most),
        total(2) {}
  cuda::DeviceClusters view() const {
    return {items.data(), indices.data(), offsets.data(), boxes.data(), count.data()};
  }
  cuda::DeviceAreaGrowth area_growth() const { return {now.data(), at_build.data(), total.data()}; }
};

void row(const char* what, double milliseconds, double floor_ms, uint32_t n, const char* note) {
  printf("| %s | %.4f | %.4f | %.2f | %.0f | %s |\n", what, milliseconds, floor_ms,
         milliseconds / floor_ms, double(n) / milliseconds / 1e3, note);
}

void measure(const std::string& name, const Mesh& mesh, int runs, double bandwidth,
             cudaStream_t stream) {
  const auto n = uint32_t(mesh.triangles.size());
  const Device<Vec3> positions(mesh.positions.data(), mesh.positions.size());
  const Device<Triangle> triangles(mesh.triangles.data(), n);
  const cuda::DeviceMesh input{positions.data(), sizeof(Vec3),
                               reinterpret_cast<const uint32_t*>(triangles.data()), nullptr, n};
  FrameClusterConfig morton, hybrid;
  morton.method = FrameMethod::kMorton;
  const Arrays a(n, max_frame_clusters(n, morton)), h(n, max_frame_clusters(n, hybrid)),
      next(n, max_frame_clusters(n, hybrid));
  Call build_a([&](void* s, size_t& b, cudaStream_t t) {
    cuda::build_frame_clusters(s, b, input, morton, a.view(), t);
  });
  Call build_h([&](void* s, size_t& b, cudaStream_t t) {
    cuda::build_frame_clusters(s, b, input, hybrid, h.view(), t);
  });
  Call measure_h([&](void* s, size_t& b, cudaStream_t t) {
    cuda::measure_frame_clusters(s, b, n, hybrid, h.view(), h.area_growth(), true, t);
  });
  cuda::DeviceMesh ordered = input;
  ordered.indices = h.indices.data();
  ordered.items = h.items.data();
  Call update_h([&](void* s, size_t& b, cudaStream_t t) {
    cuda::build_frame_clusters(s, b, ordered, hybrid, next.view(), t);
  });
  Call refit_h([&](void* s, size_t& b, cudaStream_t t) {
    cuda::refit_frame_clusters(s, b, input, hybrid, h.view(), h.area_growth(), t);
  });
  const uint32_t budget = n / 128 / 10;
  Call worst_h([&](void* s, size_t& b, cudaStream_t t) {
    cuda::rebuild_worst_frame_clusters(s, b, input, hybrid, budget, h.view(), h.area_growth(),
                                       next.view(), next.area_growth(), t);
  });
  build_h(stream);
  measure_h(stream);
  check(cudaStreamSynchronize(stream), "waiting");
  const Graph graph_a(std::ref(build_a), stream), graph_h(std::ref(build_h), stream),
      graph_refit(std::ref(refit_h), stream);
  Plain plain(positions.data(), triangles.data(), n);
  const std::vector<double> ms =
      time_all({std::ref(build_a), std::ref(graph_a), std::ref(build_h), std::ref(graph_h),
                std::ref(update_h), std::ref(refit_h), std::ref(graph_refit), std::ref(worst_h),
                std::ref(plain)},
               runs, stream);
  const Traffic traffic(n, double(mesh.positions.size()), n > (1u << 22) ? 63 : 30);
  const auto floor_of = [&](double bytes) { return 1e3 * bytes / bandwidth; };
  const double build_floor = floor_of(traffic.morton());
  const double refit_floor =
      floor_of(12.0 * n + 12.0 * double(mesh.positions.size()) + 24.0 * n / 128);
  printf("\n## %s: %u triangles, %zu vertices\n\n", name.c_str(), n, mesh.positions.size());
  printf(
      "| | ms | floor by traffic, ms | times the floor | M triangles/s | "
      "|\n|---|--:|--:|--:|--:|---|\n");
  row("Morton", ms[0], build_floor, n, "");
  row("Morton, graph", ms[1], build_floor, n, "");
  row("hybrid", ms[2], build_floor, n, "");
  row("hybrid, graph", ms[3], build_floor, n, "");
  row("hybrid, update in cluster order", ms[4], build_floor, n, "same positions");
  row("refit and measure", ms[5], refit_floor, n, "");
  row("refit and measure, graph", ms[6], refit_floor, n, "");
  row("partial rebuild, a tenth", ms[7], build_floor, n, "");
  row("plain (thrust)", ms[8], build_floor, n, "the seed's way");
  uint64_t total[2];
  check(cudaMemcpy(total, h.total.data(), sizeof total, cudaMemcpyDeviceToHost), "copying");
  printf(
      "\nplain / Morton: %.2f. Hybrid / Morton: %.2f. Area ratio of hybrid: %.3f. Scratch memory: "
      "%.1f and %.1f bytes a triangle.\n",
      ms[8] / ms[0], ms[2] / ms[0], cuda::area_growth_of(total).area_ratio,
      double(build_a.bytes()) / n, double(build_h.bytes()) / n);
}

void measure_device(const std::vector<std::pair<std::string, Mesh>>& scenes, int runs,
                    uint32_t large) {
  cudaDeviceProp device;
  check(cudaGetDeviceProperties(&device, 0), "asking for the device");
  const OwnStream own;
  cudaStream_t stream = own.get();
  const double bandwidth = copy_bandwidth(stream);
  printf(
      "# Clusters on %s\n\n%d multiprocessors, compute capability %d.%d. A copy on the device "
      "moves %.0f GB/s, reading and writing; floors are by that. Medians of %d runs, by events.\n",
      device.name, device.multiProcessorCount, device.major, device.minor, bandwidth / 1e9, runs);
  for (const auto& [name, mesh] : scenes) measure(name, mesh, runs, bandwidth, stream);
  if (large > 0) {
    const auto side = uint32_t(std::sqrt(double(large) * 5e5));
    measure("terrain", shapes::terrain(side, side, 1), runs, bandwidth, stream);
  }
}

int run_all(const bench::Arguments& arguments) {
  std::vector<std::pair<std::string, Mesh>> scenes;
  for (const std::string& path : arguments.meshes())
    scenes.emplace_back(bench::file_name(path), bench::read_mesh(path));
  if (has_device())
    measure_device(scenes, arguments.number("runs", 50, 1),
                   uint32_t(arguments.number("large", 0, 0)));
  else
    printf("# Clusters without a CUDA device\n");
  print_processor_head();
  for (const auto& [name, mesh] : scenes) measure_processor(name, mesh);
  return 0;
}

}  // namespace
}  // namespace umbel

int main(int argc, char** argv) {
  return bench::run_program("cuda_bench", argc, argv, umbel::run_all);
}
