// Builders for devices, run on one core of the processor: the program that
// `umbel bench bvh --device cuda` takes for a device's where UMBEL_CUDA_BVH_BENCH names it. See
// builder_comparison.hpp. Its times say nothing of a device; its SAH costs are a device's, too.
//
//   device_bvh_bench [--runs N] [--builder NAME]... [--large MILLIONS] MESH...
#include "builder_comparison.hpp"
#include "on_processor.hpp"

int main(int argc, char** argv) {
  return bench::run_program("device_bvh_bench", argc, argv, [](const bench::Arguments& arguments) {
    umbel::with_threads(1, [&] {
      bench::OnProcessor processor;
      bench::compare_builders(processor, arguments);
    });
    return 0;
  });
}
