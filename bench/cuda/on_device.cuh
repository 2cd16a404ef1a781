// What measures on a device: the backend of builder_comparison.hpp and device_paths.hpp.
#pragma once

#include <string>
#include <vector>

#include "cuda/run.hpp"
#include "stage_time.hpp"
#include "timing.cuh"

namespace umbel {

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

/// Marks the end of each stage in the stream. (CUDA takes no lambda for this.)
struct Stages {
  static constexpr size_t kMost = 16;

  cudaStream_t stream = nullptr;
  std::vector<Event>* events = nullptr;
  std::vector<std::string>* names = nullptr;  ///< null: of nothing

  void operator()(const char* name) const {
    if (!names || names->size() == kMost) return;
    names->push_back(name);
    (*events)[names->size()].record(stream);
  }
};

class OnDevice {
 public:
  static constexpr bool kTakesScratch = true;

  template <typename T>
  using Array = Device<T>;

  std::string name() const {
    cudaDeviceProp device;
    check(cudaGetDeviceProperties(&device, 0), "asking for the device");
    return device.name;
  }
  cuda::Stream stream() const { return stream_.get(); }
  static Stages no_stages() { return {}; }

  /// By events; the first run counts for nothing.
  template <typename Work>
  std::vector<bench::StageTime> time_stages(const Work& work, int runs) {
    std::vector<Event> events(Stages::kMost + 1);
    std::vector<std::string> names;
    std::vector<std::vector<double>> times(Stages::kMost);
    for (int run = -1; run < runs; ++run) {
      names.clear();
      events[0].record(stream());
      work(Stages{stream(), &events, &names});
      for (size_t i = 0; i < names.size(); ++i) {
        const double time = events[i + 1].milliseconds_since(events[i]);
        if (run >= 0) times[i].push_back(time);
      }
    }
    std::vector<bench::StageTime> stages;
    for (size_t i = 0; i < names.size(); ++i) stages.push_back({names[i], median(times[i])});
    return stages;
  }
  /// By events.
  template <typename Work>
  double time_once(const Work& work) {
    begin_.record(stream());
    work();
    end_.record(stream());
    return end_.milliseconds_since(begin_);
  }
  /// Once all work before is done.
  template <typename T>
  T read(const T* value) {
    T result{};
    check(cudaMemcpyAsync(&result, value, sizeof result, cudaMemcpyDeviceToHost, stream()),
          "copying");
    check(cudaStreamSynchronize(stream()), "waiting");
    return result;
  }

 private:
  OwnStream stream_;
  Event begin_, end_;
};

}  // namespace umbel
