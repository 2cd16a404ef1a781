// What src/cuda/run.cuh is for devices, for the processor: so the functions of umbel/cuda*.hpp, and
// those of C and Python over them, can be tested without a device.
#pragma once

#include "base/exec.hpp"
#include "umbel/cuda.hpp"

namespace umbel::cuda {

/// The executor allocates by itself; the scratch memory tells apart the question and the call.
template <typename Work>
void run(void* scratch, size_t& scratch_bytes, Stream /*stream*/, const Work& work) {
  CpuExec exec;
  if (scratch)
    work(exec);
  else
    scratch_bytes = 256;
}

}  // namespace umbel::cuda
