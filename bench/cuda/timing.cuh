// What the device's benchmarks share: arrays, streams, times by events, and graphs.
#pragma once

#include <cuda_runtime.h>

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "cuda/status.cuh"
#include "timing.hpp"

namespace umbel {

using bench::median, bench::processor_milliseconds, bench::thread_seconds;
using cuda::check;

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

inline bool has_device() {
  int devices = 0;
  return cudaGetDeviceCount(&devices) == cudaSuccess && devices > 0;
}

/// A stream that does not wait for the default one.
class OwnStream {
 public:
  OwnStream() {
    check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "making a stream");
  }
  OwnStream(const OwnStream&) = delete;
  OwnStream& operator=(const OwnStream&) = delete;
  ~OwnStream() { cudaStreamDestroy(stream_); }
  cudaStream_t get() const { return stream_; }

 private:
  cudaStream_t stream_ = nullptr;
};

/// Milliseconds of each of several works, by events; they take turns, after a warm-up.
inline std::vector<double> time_all(const std::vector<std::function<void(cudaStream_t)>>& works,
                                    int runs, cudaStream_t stream) {
  cudaEvent_t begin, end;
  check(cudaEventCreate(&begin), "making an event");
  check(cudaEventCreate(&end), "making an event");
  std::vector<std::vector<double>> times(works.size());
  for (int run = -3; run < runs; ++run)
    for (size_t k = 0; k < works.size(); ++k) {
      check(cudaEventRecord(begin, stream), "recording");
      works[k](stream);
      check(cudaEventRecord(end, stream), "recording");
      check(cudaEventSynchronize(end), "waiting");
      float milliseconds = 0;
      check(cudaEventElapsedTime(&milliseconds, begin, end), "timing");
      if (run >= 0) times[k].push_back(milliseconds);
    }
  cudaEventDestroy(begin);
  cudaEventDestroy(end);
  std::vector<double> medians;
  for (const auto& of_work : times) medians.push_back(median(of_work));
  return medians;
}

/// The same work as one launch.
class Graph {
 public:
  Graph(const std::function<void(cudaStream_t)>& work, cudaStream_t stream) {
    cudaGraph_t graph;
    check(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "capturing");
    work(stream);
    check(cudaStreamEndCapture(stream, &graph), "capturing");
    check(cudaGraphInstantiate(&replay_, graph, 0), "instantiating a graph");
    cudaGraphDestroy(graph);
  }
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;
  ~Graph() { cudaGraphExecDestroy(replay_); }
  void operator()(cudaStream_t stream) const {
    check(cudaGraphLaunch(replay_, stream), "replaying");
  }

 private:
  cudaGraphExec_t replay_ = nullptr;
};

/// Scratch for a call, and the call as work for a stream.
class Call {
 public:
  explicit Call(std::function<void(void*, size_t&, cudaStream_t)> call) : call_(std::move(call)) {
    call_(nullptr, bytes_, nullptr);
    check(cudaMalloc(&scratch_, bytes_), "allocating scratch memory");
  }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;
  ~Call() { cudaFree(scratch_); }
  void operator()(cudaStream_t stream) { call_(scratch_, bytes_, stream); }
  size_t bytes() const { return bytes_; }

 private:
  std::function<void(void*, size_t&, cudaStream_t)> call_;
  void* scratch_ = nullptr;
  size_t bytes_ = 0;
};

inline double copy_bandwidth(cudaStream_t stream) {
  constexpr size_t kBytes = size_t(1) << 30;
  const Device<char> from(kBytes), to(kBytes);
  const auto copy = [&](cudaStream_t s) {
    check(cudaMemcpyAsync(to.data(), from.data(), kBytes, cudaMemcpyDeviceToDevice, s), "copying");
  };
  return 2.0 * double(kBytes) / (1e-3 * time_all({copy}, 20, stream)[0]);
}

}  // namespace umbel
