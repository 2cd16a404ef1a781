// A frame of a mesh that deforms, as one CUDA graph: move the vertices, cluster the triangles
// again, build a tree for each cluster and one over them, and trace rays. Once captured, a frame is
// one launch; the host neither waits nor looks at anything in between.
#pragma once

#include <cuda_runtime.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "umbel/cuda.hpp"

namespace example {

inline void check(cudaError_t result) {
  if (result != cudaSuccess) throw std::runtime_error(cudaGetErrorString(result));
}

/// An array on the device.
template <typename T>
class Array {
 public:
  explicit Array(size_t size)
      : size_(size), memory_(static_cast<T*>(umbel::cuda::device_allocate(size * sizeof(T)))) {}
  explicit Array(const std::vector<T>& values) : Array(values.size()) {
    umbel::cuda::device_copy(memory_, values.data(), size_ * sizeof(T));
  }
  Array(const Array&) = delete;
  Array& operator=(const Array&) = delete;
  ~Array() { umbel::cuda::device_free(memory_); }

  T* data() const { return memory_; }
  size_t size() const { return size_; }
  std::vector<T> read(size_t count) const {
    std::vector<T> values(count);
    umbel::cuda::device_copy(values.data(), memory_, count * sizeof(T));
    return values;
  }
  std::vector<T> read() const { return read(size_); }

 private:
  size_t size_;
  T* memory_;
};

/// The next frame's time: nothing of a frame comes from the host.
__global__ void advance(float* time, float step) {
  if (threadIdx.x == 0) *time += step;
}

/// Turns every vertex about the x axis, the more the farther along it.
__global__ void twist(const umbel::Vec3* rest, const float* time, uint32_t count,
                      umbel::Vec3* out) {
  const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= count) return;
  const umbel::Vec3 p = rest[i];
  const float angle = *time * p.x, c = cosf(angle), s = sinf(angle);
  out[i] = {p.x, p.y * c - p.z * s, p.y * s + p.z * c};
}

class FrameGraph {
 public:
  FrameGraph(const std::vector<umbel::Vec3>& rest, const std::vector<umbel::Triangle>& triangles,
             const std::vector<umbel::Vec3>& origins, const std::vector<umbel::Vec3>& directions,
             float step)
      : step_(step),
        rest_(rest),
        positions(rest.size()),
        triangles_(triangles),
        origins_(origins),
        directions_(directions),
        time_(std::vector<float>{0}),
        items(triangles.size()),
        indices(3 * triangles.size()),
        offsets(most(triangles) + 1),
        boxes(most(triangles)),
        count(1),
        nodes(umbel::bvh::compact_node_capacity(uint32_t(triangles.size()))),
        leaves(triangles.size()),
        info(1),
        t(origins.size()),
        primitives(origins.size()),
        scratch_(scratch_bytes()) {
    check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking));
    capture();
  }
  FrameGraph(const FrameGraph&) = delete;
  FrameGraph& operator=(const FrameGraph&) = delete;
  ~FrameGraph() {
    cudaGraphExecDestroy(replay_);
    cudaStreamDestroy(stream_);
  }

  /// Starts the next frame.
  void run() { check(cudaGraphLaunch(replay_, stream_)); }
  cudaStream_t stream() const { return stream_; }
  static umbel::FrameClusterConfig cluster_config() { return {}; }
  static umbel::cuda::DeviceBvhConfig bvh_config() {
    return umbel::cuda::device_builder_preset("lbvh");
  }

 private:
  float step_;
  Array<umbel::Vec3> rest_;

 public:
  Array<umbel::Vec3> positions;  ///< of the last frame, as all that follows

 private:
  Array<umbel::Triangle> triangles_;
  Array<umbel::Vec3> origins_, directions_;
  Array<float> time_;

 public:
  Array<uint32_t> items, indices, offsets;
  Array<umbel::Aabb> boxes;
  Array<uint32_t> count;
  Array<umbel::bvh::CompactNode> nodes;
  Array<umbel::bvh::CompactTriangle> leaves;
  Array<umbel::bvh::CompactInfo> info;
  Array<float> t;
  Array<uint32_t> primitives;

 private:
  static uint32_t most(const std::vector<umbel::Triangle>& triangles) {
    return umbel::max_frame_clusters(uint32_t(triangles.size()), cluster_config());
  }
  umbel::cuda::DeviceMesh mesh() const {
    return {positions.data(), sizeof(umbel::Vec3),
            reinterpret_cast<const uint32_t*>(triangles_.data()), nullptr,
            uint32_t(triangles_.size())};
  }
  umbel::cuda::DeviceClusters clusters() const {
    return {items.data(), indices.data(), offsets.data(), boxes.data(), count.data()};
  }

  /// Each step may use all of the scratch memory, as one follows the other in the stream.
  void put_steps(void* scratch, size_t& bytes, cudaStream_t stream) const {
    const umbel::cuda::DeviceBvh bvh{nodes.data(), leaves.data(), info.data()};
    umbel::cuda::DeviceRays rays;
    rays.origins = origins_.data();
    rays.directions = directions_.data();
    rays.count = origins_.size();
    const size_t room = bytes;
    size_t needed[3] = {room, room, room};
    umbel::cuda::build_frame_clusters(scratch, needed[0], mesh(), cluster_config(), clusters(),
                                      stream);
    umbel::cuda::build_cluster_bvh(scratch, needed[1], mesh(), cluster_config(), clusters(),
                                   bvh_config(), bvh, stream);
    umbel::cuda::intersect_rays(scratch, needed[2], bvh, rays,
                                {t.data(), primitives.data(), nullptr}, stream);
    for (const size_t n : needed)
      if (n > bytes) bytes = n;
  }
  size_t scratch_bytes() const {
    size_t bytes = 0;
    put_steps(nullptr, bytes, nullptr);
    return bytes;
  }

  template <typename... Parameters, typename... Arguments>
  void launch(void (*kernel)(Parameters...), uint32_t threads, const Arguments&... arguments) {
    cudaLaunchConfig_t config{};
    config.gridDim = dim3((threads + 255) / 256);
    config.blockDim = dim3(256);
    config.stream = stream_;
    check(cudaLaunchKernelEx(&config, kernel, arguments...));
  }

  void capture() {
    const auto vertices = uint32_t(rest_.size());
    cudaGraph_t graph;
    check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal));
    launch(advance, 1, time_.data(), step_);
    launch(twist, vertices, rest_.data(), time_.data(), vertices, positions.data());
    size_t bytes = scratch_.size();
    put_steps(scratch_.data(), bytes, stream_);
    check(cudaStreamEndCapture(stream_, &graph));
    check(cudaGraphInstantiate(&replay_, graph, 0));
    cudaGraphDestroy(graph);
  }

  Array<unsigned char> scratch_;
  cudaStream_t stream_ = nullptr;
  cudaGraphExec_t replay_ = nullptr;
};

}  // namespace example
