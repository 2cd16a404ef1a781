// The functions of umbel/cuda.hpp, and so of umbel_cuda.h, with the memory and the cores of the
// processor: what calls them can be tested without a device.
#include "base/exec.hpp"
#include "umbel/cuda.hpp"

namespace umbel::cuda {
namespace {

/// The executor allocates by itself; the scratch memory tells apart the question and the call.
template <typename Work>
void run(void* scratch, size_t& scratch_bytes, Stream /*stream*/, const Work& work) {
  CpuExec exec;
  if (scratch)
    work(exec);
  else
    scratch_bytes = 256;
}

}  // namespace
}  // namespace umbel::cuda

#include "cuda/frame_functions.hpp"  // needs what is above
