// Builders of hierarchies on the device, for `umbel bench bvh --device cuda`: see
// builder_comparison.hpp.
//
//   cuda_bvh_bench [--runs N] [--builder NAME]... [--large MILLIONS] MESH...
#include "on_device.cuh"
// What is above comes first.
#include "builder_comparison.hpp"

int main(int argc, char** argv) {
  return bench::run_program("cuda_bvh_bench", argc, argv, [](const bench::Arguments& arguments) {
    if (!umbel::has_device()) {
      fprintf(stderr, "cuda_bvh_bench: CUDA finds no device\n");
      return 3;
    }
    umbel::OnDevice device;
    bench::compare_builders(device, arguments);
    return 0;
  });
}
