// What the stand-ins for CUB's device-wide primitives share.
#pragma once

#include <cuda_runtime.h>

namespace umbel::simt {

/// Questions for sizes of scratch memory.
inline thread_local size_t questions = 0;

/// What scratch memory for so many items takes more than for none.
inline size_t some_of(int64_t items) { return size_t(items) % 251; }

/// Answers the question for the size of the scratch memory, or queues the work, which may use all
/// of it.
template <typename Work>
cudaError_t cub_call(void* scratch, size_t& bytes, size_t wanted, cudaStream_t stream, Work work) {
  if (!scratch) {
    ++questions;
    bytes = wanted;
    return cudaSuccess;
  }
  if (bytes < wanted) return cudaErrorInvalidValue;
  enqueue(stream, [=] { memset(scratch, 0x3c, wanted); });
  enqueue(stream, work);
  return cudaSuccess;
}

/// Some length of a tile that a block does.
inline size_t tile_length(size_t left) {
  const size_t length = 1 + random_below(random_below(2) ? 8 : 300);
  return length < left ? length : left;
}

}  // namespace umbel::simt
