// How the functions of umbel/cuda*.hpp run work that is written over an executor. A CUDA compiler
// takes the device's executor. Any other takes the processor's: so tests compile the same sources
// for machines without a device (tests/on_processor).
#pragma once

#include <cstddef>

#include "umbel/cuda_types.hpp"

#if defined(__CUDACC__)
#include <algorithm>

#include "cuda/cuda_exec.cuh"
#else
#include "base/exec.hpp"
#endif

namespace umbel::cuda {

#if defined(__CUDACC__)

/// Runs work(executor) over the scratch memory, or finds out how much it needs.
template <typename Work>
void run(void* scratch, size_t& scratch_bytes, Stream stream, const Work& work) {
  Arena arena = scratch ? Arena(scratch, scratch_bytes) : Arena();
  CudaExec exec(stream, arena);
  work(exec);
  // Never 0, so that there is something to allocate.
  if (!scratch) scratch_bytes = std::max(arena.most(), Arena::kAlignment);
}

#else

/// The same interface. This executor allocates by itself; `scratch` only tells whether to run.
template <typename Work>
void run(void* scratch, size_t& scratch_bytes, Stream /*stream*/, const Work& work) {
  CpuExec exec;
  if (scratch)
    work(exec);
  else
    scratch_bytes = 256;
}

#endif

}  // namespace umbel::cuda
