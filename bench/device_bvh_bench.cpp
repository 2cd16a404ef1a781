// Builders for devices, run on one core of the processor: the program that
// `umbel bench bvh --device cuda` takes for a device's where UMBEL_CUDA_BVH_BENCH names it. See
// builder_comparison.hpp. Its times say nothing of a device; its SAH costs are a device's, too.
//
//   device_bvh_bench [--runs N] [--builder NAME]... [--large MILLIONS] MESH...
#include "builder_comparison.hpp"
// The processor's form of these, as in tests/on_processor.
#include "cuda/bvh.cu"
#include "cuda/trace.cu"

namespace {

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
  std::vector<bench::StageTime> time_stages(const Work& work, int runs) {
    std::vector<bench::StageTime> stages;
    std::vector<std::vector<double>> times;
    for (int run = 0; run < runs; ++run) {
      size_t number = 0;
      double last = bench::thread_seconds();
      work([&](const char* stage) {
        const double now = bench::thread_seconds();
        if (run == 0) {
          stages.push_back({stage, 0});
          times.emplace_back();
        }
        times[number++].push_back(1e3 * (now - last));
        last = bench::thread_seconds();
      });
    }
    for (size_t i = 0; i < stages.size(); ++i) stages[i].milliseconds = bench::median(times[i]);
    return stages;
  }
  template <typename T>
  T read(const T* value) {
    return *value;
  }
};

}  // namespace

int main(int argc, char** argv) {
  return bench::run_program("device_bvh_bench", argc, argv, [](const bench::Arguments& arguments) {
    umbel::with_threads(1, [&] {
      OnProcessor processor;
      bench::compare_builders(processor, arguments);
    });
    return 0;
  });
}
