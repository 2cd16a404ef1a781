// What measures device code by running it on one core of the processor: the backend of
// builder_comparison.hpp and device_paths.hpp where there is no device.
#pragma once

// The processor's form of these, as in tests/on_processor.
#include <algorithm>
#include <string>
#include <vector>

#include "clocks.hpp"
#include "cuda/bvh.cu"
#include "cuda/trace.cu"
#include "stage_time.hpp"

namespace bench {

class OnProcessor {
 public:
  static constexpr bool kTakesScratch = false;

  template <typename T>
  class Array {
   public:
    explicit Array(size_t size) : memory_(size) {}
    Array(const T* values, size_t size) : Array(size) {
      std::copy(values, values + size, memory_.data());
    }
    T* data() const { return memory_.data(); }

   private:
    umbel::CpuBuffer<T> memory_;
  };

  static std::string name() { return "one core of the processor, not on a device"; }
  static umbel::cuda::Stream stream() { return nullptr; }
  static umbel::cuda::NoStages no_stages() { return {}; }

  /// By the time of the thread.
  template <typename Work>
  std::vector<StageTime> time_stages(const Work& work, int runs) {
    std::vector<StageTime> stages;
    std::vector<std::vector<double>> times;
    for (int run = 0; run < runs; ++run) {
      size_t number = 0;
      double last = thread_seconds();
      work([&](const char* stage) {
        const double now = thread_seconds();
        if (run == 0) {
          stages.push_back({stage, 0});
          times.emplace_back();
        }
        times[number++].push_back(1e3 * (now - last));
        last = thread_seconds();
      });
    }
    for (size_t i = 0; i < stages.size(); ++i) stages[i].milliseconds = median(times[i]);
    return stages;
  }
  template <typename Work>
  double time_once(const Work& work) {
    const double begun = thread_seconds();
    work();
    return 1e3 * (thread_seconds() - begun);
  }
  template <typename T>
  T read(const T* value) {
    return *value;
  }
};

}  // namespace bench
