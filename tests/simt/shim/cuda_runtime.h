// CUDA's language and the part of its runtime that Umbel and its tests use, over the machine of
// tests/simt.
#pragma once

#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <type_traits>
#include <utility>

#include "machine.hpp"
#include "streams.hpp"

// The language.

#define __global__
#define __device__
#define __host__
#define __launch_bounds__(...)
#define __forceinline__ inline __attribute__((always_inline))

inline const umbel::simt::Index3& threadIdx = umbel::simt::thread_index;
inline const umbel::simt::Index3& blockIdx = umbel::simt::block_index;
inline const umbel::simt::Index3& blockDim = umbel::simt::block_size;
inline const umbel::simt::Index3& gridDim = umbel::simt::grid_size;

/// See src/cuda/device_team.cuh.
#define UMBEL_SHARED(Type, name, count)  \
  static const char name##_of_block = 0; \
  Type* const name =                     \
      static_cast<Type*>(umbel::simt::shared_memory(&name##_of_block, (count) * sizeof(Type)))
/// See src/cuda/cuda_exec.cuh.
#define UMBEL_MOST_BLOCKS 2
#define UMBEL_FEW_THREADS 1024
#define UMBEL_CHUNK_CODES 32
/// See src/cuda/arena.hpp.
#define UMBEL_POISON(memory, bytes) umbel::simt::poison(memory, bytes)
/// See src/base/exec.hpp.
#define UMBEL_ADD_RELEASE(counter, amount) umbel_simt_add_release(counter, amount)
#define UMBEL_EXCHANGE_RELEASE(word, value) umbel_simt_exchange_release(word, value)
#define UMBEL_ACQUIRE() umbel::simt::acquire_last()

struct alignas(16) uint4 {
  unsigned x, y, z, w;
};

#define UMBEL_SIMT_INLINE inline __attribute__((always_inline))

UMBEL_SIMT_INLINE void __syncthreads() { umbel::simt::meet_block(); }
UMBEL_SIMT_INLINE int __syncthreads_count(int flag) {
  return int(umbel::simt::count_in_block(flag != 0));
}
UMBEL_SIMT_INLINE void __syncwarp(unsigned mask = 0xffffffffu) {
  umbel::simt::meet_warp(umbel::simt::WarpOp::kSync, mask, 0, 0);
}
UMBEL_SIMT_INLINE unsigned __ballot_sync(unsigned mask, int flag) {
  return unsigned(umbel::simt::meet_warp(umbel::simt::WarpOp::kBallot, mask, flag != 0, 0));
}
UMBEL_SIMT_INLINE int __any_sync(unsigned mask, int flag) { return __ballot_sync(mask, flag) != 0; }
template <typename T>
UMBEL_SIMT_INLINE T __shfl_sync(unsigned mask, T value, int from) {
  return T(
      umbel::simt::meet_warp(umbel::simt::WarpOp::kShuffle, mask, uint64_t(value), uint32_t(from)));
}
template <typename T>
UMBEL_SIMT_INLINE T __shfl_xor_sync(unsigned mask, T value, int bits) {
  return T(umbel::simt::meet_warp(umbel::simt::WarpOp::kShuffleXor, mask, uint64_t(value),
                                  uint32_t(bits)));
}
template <typename T>
UMBEL_SIMT_INLINE unsigned __match_any_sync(unsigned mask, T value) {
  return unsigned(umbel::simt::meet_warp(umbel::simt::WarpOp::kMatch, mask, uint64_t(value), 0));
}
UMBEL_SIMT_INLINE unsigned __activemask() { return umbel::simt::gather_lanes(); }

UMBEL_SIMT_INLINE int __popc(unsigned bits) { return std::popcount(bits); }
UMBEL_SIMT_INLINE int __popcll(unsigned long long bits) { return std::popcount(bits); }
UMBEL_SIMT_INLINE int __clz(int bits) { return std::countl_zero(unsigned(bits)); }
UMBEL_SIMT_INLINE int __clzll(long long bits) {
  return std::countl_zero(static_cast<unsigned long long>(bits));
}
UMBEL_SIMT_INLINE int __ffsll(long long bits) {
  return bits ? std::countr_zero(static_cast<unsigned long long>(bits)) + 1 : 0;
}
UMBEL_SIMT_INLINE int __ffs(int bits) { return bits ? std::countr_zero(unsigned(bits)) + 1 : 0; }
UMBEL_SIMT_INLINE float __fmaf_rn(float a, float b, float c) { return std::fma(a, b, c); }
template <typename T>
UMBEL_SIMT_INLINE T __ldg(const T* from) {
  return *from;
}
template <typename T>
UMBEL_SIMT_INLINE T __ldcg(const T* from) {
  return *from;
}

template <typename T>
inline T atomicAdd(T* to, std::type_identity_t<T> amount) {
  umbel::simt::before_atomic(to);
  return std::atomic_ref<T>(*to).fetch_add(amount, std::memory_order_relaxed);
}
template <typename T>
inline T atomicOr(T* to, std::type_identity_t<T> bits) {
  umbel::simt::before_atomic(to);
  return std::atomic_ref<T>(*to).fetch_or(bits, std::memory_order_relaxed);
}
/// Replaces a value by the other one if that is `better`.
template <typename T, typename Better>
inline T umbel_simt_exchange_if(T* to, T value, const Better& better) {
  umbel::simt::before_atomic(to);
  const std::atomic_ref<T> shared(*to);
  T seen = shared.load(std::memory_order_relaxed);
  while (better(value, seen) &&
         !shared.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
  }
  return seen;
}
template <typename T>
inline T atomicMin(T* to, std::type_identity_t<T> value) {
  return umbel_simt_exchange_if(to, value, std::less<T>());
}
template <typename T>
inline T atomicMax(T* to, std::type_identity_t<T> value) {
  return umbel_simt_exchange_if(to, value, std::greater<T>());
}
template <typename T>
inline T atomicCAS(T* to, std::type_identity_t<T> expected, std::type_identity_t<T> value) {
  umbel::simt::before_atomic(to);
  std::atomic_ref<T>(*to).compare_exchange_strong(expected, value, std::memory_order_relaxed);
  return expected;
}
UMBEL_SIMT_INLINE uint32_t umbel_simt_add_release(uint32_t* counter, uint32_t amount) {
  const bool releases = umbel::simt::releases(counter);
  return std::atomic_ref<uint32_t>(*counter).fetch_add(
      amount, releases ? std::memory_order_release : std::memory_order_relaxed);
}
UMBEL_SIMT_INLINE uint64_t umbel_simt_exchange_release(uint64_t* word, uint64_t value) {
  const bool releases = umbel::simt::releases(word);
  return std::atomic_ref<uint64_t>(*word).exchange(
      value, releases ? std::memory_order_release : std::memory_order_relaxed);
}

// The runtime.

enum cudaError_t {
  cudaSuccess,
  cudaErrorInvalidValue,
  cudaErrorCooperativeLaunchTooLarge,
  cudaErrorStreamCaptureUnsupported
};
inline const char* cudaGetErrorString(cudaError_t) { return "an emulated call failed"; }
inline const char* cudaGetErrorName(cudaError_t) { return "cudaErrorEmulated"; }
inline cudaError_t cudaGetLastError() { return cudaSuccess; }

struct CUstream_st : umbel::simt::StreamState {};
using cudaStream_t = CUstream_st*;
using cudaGraph_t = umbel::simt::Graph*;
using cudaGraphExec_t = umbel::simt::Graph*;

enum cudaMemcpyKind {
  cudaMemcpyHostToDevice,
  cudaMemcpyDeviceToHost,
  cudaMemcpyDeviceToDevice,
  cudaMemcpyDefault
};
enum cudaStreamCaptureMode { cudaStreamCaptureModeThreadLocal };
inline constexpr unsigned cudaStreamNonBlocking = 1;

inline cudaError_t cudaGetDeviceCount(int* count) { return *count = 2, cudaSuccess; }

inline cudaError_t cudaGetDevice(int* device) {
  return *device = umbel::simt::current_device(), cudaSuccess;
}
inline cudaError_t cudaSetDevice(int device) {
  return umbel::simt::set_device(device), cudaSuccess;
}
enum cudaMemoryType { cudaMemoryTypeUnregistered, cudaMemoryTypeHost, cudaMemoryTypeDevice };
struct cudaPointerAttributes {
  cudaMemoryType type;
  int device;
};
inline cudaError_t cudaPointerGetAttributes(cudaPointerAttributes* found, const void* memory) {
  const int device = umbel::simt::device_of(memory);
  *found = {device < 0 ? cudaMemoryTypeUnregistered : cudaMemoryTypeDevice, device};
  return cudaSuccess;
}

inline cudaError_t cudaDeviceSynchronize() { return umbel::simt::finish(), cudaSuccess; }
inline cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
  if (stream && stream->captures) return cudaErrorStreamCaptureUnsupported;
  return umbel::simt::finish(), cudaSuccess;
}
template <typename T>
cudaError_t cudaMalloc(T** memory, size_t bytes) {
  *memory = static_cast<T*>(std::aligned_alloc(256, (bytes + 255) / 256 * 256));
  umbel::simt::allocated(*memory, bytes);
  return cudaSuccess;
}
inline cudaError_t cudaFree(void* memory) {
  umbel::simt::finish();
  umbel::simt::freed(memory);
  std::free(memory);
  return cudaSuccess;
}
inline cudaError_t cudaMemset(void* to, int value, size_t bytes) {
  umbel::simt::finish();
  memset(to, value, bytes);
  return cudaSuccess;
}
inline cudaError_t cudaMemcpy(void* to, const void* from, size_t bytes, cudaMemcpyKind) {
  umbel::simt::finish();
  if (bytes > 0) memcpy(to, from, bytes);
  return cudaSuccess;
}
inline cudaError_t cudaMemsetAsync(void* to, int value, size_t bytes, cudaStream_t stream) {
  umbel::simt::enqueue(stream, [=] { memset(to, value, bytes); });
  return cudaSuccess;
}
inline cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind,
                                   cudaStream_t stream) {
  umbel::simt::enqueue(stream, [=] {
    if (bytes > 0) memcpy(to, from, bytes);
  });
  return cudaSuccess;
}

inline cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned) {
  *stream = new CUstream_st;
  return cudaSuccess;
}
inline cudaError_t cudaStreamCreate(cudaStream_t* stream) {
  return cudaStreamCreateWithFlags(stream, 0);
}
inline cudaError_t cudaStreamDestroy(cudaStream_t stream) {
  umbel::simt::finish();
  delete stream;
  return cudaSuccess;
}
enum cudaStreamCaptureStatus { cudaStreamCaptureStatusNone, cudaStreamCaptureStatusActive };
inline cudaError_t cudaStreamIsCapturing(cudaStream_t stream, cudaStreamCaptureStatus* status) {
  const bool captures = stream && stream->captures;
  *status = captures ? cudaStreamCaptureStatusActive : cudaStreamCaptureStatusNone;
  return cudaSuccess;
}
inline cudaError_t cudaStreamBeginCapture(cudaStream_t stream, cudaStreamCaptureMode) {
  umbel::simt::begin_capture(*stream);
  return cudaSuccess;
}
inline cudaError_t cudaStreamEndCapture(cudaStream_t stream, cudaGraph_t* graph) {
  *graph = new umbel::simt::Graph(umbel::simt::end_capture(*stream));
  return cudaSuccess;
}
inline cudaError_t cudaGraphInstantiate(cudaGraphExec_t* exec, cudaGraph_t graph, unsigned) {
  *exec = new umbel::simt::Graph(*graph);
  return cudaSuccess;
}
inline cudaError_t cudaGraphLaunch(cudaGraphExec_t exec, cudaStream_t stream) {
  for (const umbel::simt::Work& work : exec->work) umbel::simt::enqueue(stream, work);
  return cudaSuccess;
}
inline cudaError_t cudaGraphExecDestroy(cudaGraphExec_t exec) {
  umbel::simt::finish();
  delete exec;
  return cudaSuccess;
}
inline cudaError_t cudaGraphDestroy(cudaGraph_t graph) {
  delete graph;
  return cudaSuccess;
}

// Launches.

enum cudaDeviceAttr { cudaDevAttrMultiProcessorCount };
inline cudaError_t cudaDeviceGetAttribute(int* value, cudaDeviceAttr, int) {
  *value = umbel::simt::multiprocessors();
  return cudaSuccess;
}
template <typename Kernel>
cudaError_t cudaOccupancyMaxActiveBlocksPerMultiprocessor(int* blocks, Kernel*, int, size_t) {
  *blocks = umbel::simt::blocks_per_multiprocessor();
  return cudaSuccess;
}

struct dim3 {
  unsigned x, y, z;
  dim3(unsigned count = 1) : x(count), y(1), z(1) {}
};
enum cudaLaunchAttributeID { cudaLaunchAttributeCooperative };
union cudaLaunchAttributeValue {
  int cooperative;
};
struct cudaLaunchAttribute {
  cudaLaunchAttributeID id;
  cudaLaunchAttributeValue val;
};
struct cudaLaunchConfig_t {
  dim3 gridDim, blockDim;
  size_t dynamicSmemBytes = 0;
  cudaStream_t stream = nullptr;
  cudaLaunchAttribute* attrs = nullptr;
  unsigned numAttrs = 0;
};

/// Arguments are copied, as CUDA does, and every thread has its own copy.
template <typename... Parameters, typename... Arguments>
cudaError_t cudaLaunchKernelEx(const cudaLaunchConfig_t* config, void (*kernel)(Parameters...),
                               Arguments&&... arguments) {
  const bool is_cooperative = config->numAttrs > 0 && config->attrs[0].val.cooperative;
  const unsigned blocks = config->gridDim.x, threads = config->blockDim.x;
  if (blocks == 0 || threads == 0 || threads > 1024) return cudaErrorInvalidValue;
  if (is_cooperative && blocks > umbel::simt::blocks_together())
    return cudaErrorCooperativeLaunchTooLarge;
  umbel::simt::launched();
  umbel::simt::enqueue(
      config->stream, [=, ... values = static_cast<std::decay_t<Parameters>>(arguments)]() {
        umbel::simt::run_grid(blocks, threads, is_cooperative, [&] { kernel(values...); });
      });
  return cudaSuccess;
}
