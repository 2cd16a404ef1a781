// umbel_cuda_memory.h over cuda_memory.hpp. Part of the library umbel::cuda.
#include "capi/cuda/input.hpp"
#include "capi/guard.hpp"
#include "umbel/cuda_memory.hpp"
#include "umbel/umbel_cuda_memory.h"

using umbel::capi::guard;
using umbel::capi::required;
using umbel::capi::stream_of;

umbel_result umbel_cuda_allocate(size_t bytes, void** memory) {
  return guard([&] { required(memory, "memory") = umbel::cuda::device_allocate(bytes); });
}

umbel_result umbel_cuda_free(void* memory) {
  return guard([&] { umbel::cuda::device_free(memory); });
}

umbel_result umbel_cuda_copy(void* to, const void* from, size_t bytes, void* stream) {
  return guard([&] { umbel::cuda::device_copy(to, from, bytes, stream_of(stream)); });
}

umbel_result umbel_cuda_wait(void* stream, const void* place) {
  return guard([&] { umbel::cuda::wait_for(stream_of(stream), place); });
}

umbel_result umbel_cuda_is_captured(void* stream, const void* place, int* captured) {
  return guard([&] {
    required(captured, "captured") = umbel::cuda::is_captured(stream_of(stream), place) ? 1 : 0;
  });
}
