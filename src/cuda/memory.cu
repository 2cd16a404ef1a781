// The functions of umbel/cuda_memory.hpp.

#include "cuda/run.hpp"
#include "umbel/cuda_memory.hpp"

#if defined(__CUDACC__)

namespace umbel::cuda {

void* device_allocate(size_t bytes) {
  void* memory = nullptr;
  check(cudaMalloc(&memory, bytes > 0 ? bytes : 1), "allocating on the device");
  return memory;
}

void device_free(void* memory) noexcept {
  if (memory) cudaFree(memory);
}

void device_copy(void* to, const void* from, size_t bytes, Stream stream) {
  if (bytes == 0) return;
  const DeviceGuard of_from(from);
  const DeviceGuard of_to(to);
  check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDefault, stream), "copying");
  check(cudaStreamSynchronize(stream), "waiting for the stream");
}

void wait_for(Stream stream, const void* place) {
  const DeviceGuard guard(place);
  check(cudaStreamSynchronize(stream), "waiting for the stream");
}

bool is_captured(Stream stream, const void* place) {
  const DeviceGuard guard(place);
  cudaStreamCaptureStatus status = cudaStreamCaptureStatusNone;
  check(cudaStreamIsCapturing(stream, &status), "asking for the state of the stream");
  return status != cudaStreamCaptureStatusNone;
}

}  // namespace umbel::cuda

#else

#include <cstring>
#include <new>

// The processor's form, for tests: all memory is the host's, and nothing is ever late.
namespace umbel::cuda {

void* device_allocate(size_t bytes) { return ::operator new(bytes, std::align_val_t(256)); }

void device_free(void* memory) noexcept { ::operator delete(memory, std::align_val_t(256)); }

void device_copy(void* to, const void* from, size_t bytes, Stream /*stream*/) {
  if (bytes > 0) std::memcpy(to, from, bytes);
}

void wait_for(Stream /*stream*/, const void* /*place*/) {}

bool is_captured(Stream /*stream*/, const void* /*place*/) { return false; }

}  // namespace umbel::cuda

#endif
