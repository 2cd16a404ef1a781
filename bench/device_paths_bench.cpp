// Pictures traced through the trees of builders for devices, on one core of the processor: the same
// rays, hits and SAH costs as a device's. Its times say nothing of a device. See device_paths.hpp.
//
//   device_paths_bench [--size W,H] [--samples N] [--builder NAME]... --camera CAMERA... MESH
#include "device_paths.hpp"
#include "on_processor.hpp"

int main(int argc, char** argv) {
  return bench::run_program("device_paths_bench", argc, argv,
                            [](const bench::Arguments& arguments) {
                              umbel::with_threads(1, [&] {
                                bench::OnProcessor processor;
                                bench::trace_paths(processor, arguments);
                              });
                              return 0;
                            });
}
