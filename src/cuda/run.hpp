// How the functions of umbel/cuda*.hpp run work that is written over an executor. A CUDA compiler
// takes the device's executor. Any other takes the processor's: so tests compile the same sources
// for machines without a device (tests/on_processor).
#pragma once

#include <cstddef>

#include "umbel/cuda_types.hpp"

#if defined(__CUDACC__)
#include <algorithm>

#include "cuda/cuda_exec.cuh"
#include "cuda/device_guard.hpp"
#else
#include "base/exec.hpp"
#endif

namespace umbel::cuda {

#if defined(__CUDACC__)

/// Runs work(executor) over the scratch memory, or finds out how much it needs. `place` is memory
/// of the device to work on, which need not be the current one.
template <typename Work>
void run(void* scratch, size_t& scratch_bytes, Stream stream, const void* place, const Work& work) {
  const DeviceGuard guard(scratch ? scratch : place);
  Arena arena = scratch ? Arena(scratch, scratch_bytes) : Arena();
  CudaExec exec(stream, arena);
  work(exec);
  // Never 0, so that there is something to allocate.
  if (!scratch) scratch_bytes = std::max(arena.most(), Arena::kAlignment);
}

/// Runs what takes no scratch memory.
template <typename Work>
void run_alone(Stream stream, const void* place, const Work& work) {
  const DeviceGuard guard(place);
  Arena arena(nullptr, 0);
  CudaExec exec(stream, arena);
  work(exec);
}

#else

/// The same interface. This executor allocates by itself; `scratch` only tells whether to run.
template <typename Work>
void run(void* scratch, size_t& scratch_bytes, Stream /*stream*/, const void* /*place*/,
         const Work& work) {
  CpuExec exec;
  if (scratch)
    work(exec);
  else
    scratch_bytes = 256;
}

template <typename Work>
void run_alone(Stream /*stream*/, const void* /*place*/, const Work& work) {
  CpuExec exec;
  work(exec);
}

#endif

}  // namespace umbel::cuda
