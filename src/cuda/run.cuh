// How the device functions of umbel/cuda*.hpp run work that is written over an executor.
#pragma once

#include <algorithm>

#include "cuda/cuda_exec.cuh"
#include "umbel/cuda.hpp"

namespace umbel::cuda {

/// Runs `work` on an executor over the scratch memory, or finds out how much it needs.
template <typename Work>
void run(void* scratch, size_t& scratch_bytes, Stream stream, const Work& work) {
  Arena arena = scratch ? Arena(scratch, scratch_bytes) : Arena();
  CudaExec exec(stream, arena);
  work(exec);
  // Never 0, so that there is something to allocate.
  if (!scratch) scratch_bytes = std::max(arena.most(), Arena::kAlignment);
}

}  // namespace umbel::cuda
