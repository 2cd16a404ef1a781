// Pictures traced through the trees of the device's builders: see device_paths.hpp.
//
//   cuda_paths_bench [--size W,H] [--samples N] [--builder NAME]... --camera CAMERA... MESH
#include "on_device.cuh"
// What is above comes first.
#include "device_paths.hpp"

int main(int argc, char** argv) {
  return bench::run_program("cuda_paths_bench", argc, argv, [](const bench::Arguments& arguments) {
    if (!umbel::has_device()) {
      fprintf(stderr, "cuda_paths_bench: CUDA finds no device\n");
      return 3;
    }
    umbel::OnDevice device;
    bench::trace_paths(device, arguments);
    return 0;
  });
}
