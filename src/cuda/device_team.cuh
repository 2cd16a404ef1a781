// Teams on a device: a warp, a block, or 8 lanes of a warp.
#pragma once

#include <cuda_runtime.h>

#include <cstdint>
#include <cstring>

#include "base/team.hpp"

// An array of a block. The emulator of tests/simt has its own.
#if !defined(UMBEL_SHARED)
#define UMBEL_SHARED(Type, name, count) __shared__ alignas(16) Type name[count]
#endif

namespace umbel::cuda {

inline constexpr uint32_t kWarp = 32;
inline constexpr uint32_t kAllLanes = 0xffffffffu;

/// The value of lane `rank ^ mask` of those lanes of the warp, for any type of whole words.
template <typename T>
__device__ inline T shuffle_xor(const T& value, uint32_t mask, uint32_t lanes = kAllLanes) {
  static_assert(sizeof(T) % sizeof(uint32_t) == 0);
  uint32_t words[sizeof(T) / sizeof(uint32_t)];
  memcpy(words, &value, sizeof(T));
  for (uint32_t& word : words) word = __shfl_xor_sync(lanes, word, mask);
  T result;
  memcpy(&result, words, sizeof(T));
  return result;
}

template <typename T, typename Op>
__device__ inline T warp_reduce(T value, const Op& op) {
  for (uint32_t mask = kWarp / 2; mask > 0; mask /= 2) value = op(value, shuffle_xor(value, mask));
  return value;
}

/// What teams of any size do alike.
struct DeviceTeam {
  static constexpr bool kIsSerial = false;

  __device__ static uint32_t add(uint32_t* counter, uint32_t amount) {
    return atomicAdd(counter, amount);
  }
  template <typename T>
  __device__ static void lower(T* least, T value) {
    atomicMin(least, value);
  }
  __device__ static uint32_t claim(uint32_t* word, uint32_t free, uint32_t value) {
    return atomicCAS(word, free, value);
  }
};

struct WarpTeam : DeviceTeam {
  __device__ static uint32_t size() { return kWarp; }
  __device__ static uint32_t rank() { return threadIdx.x % kWarp; }
  __device__ __forceinline__ void sync() const { __syncwarp(); }

  template <typename T, typename Op>
  __device__ T reduce(const T& value, const Op& op) const {
    const T result = warp_reduce(value, op);
    __syncwarp();
    return result;
  }
  __device__ uint32_t rank_among(bool flag) const {
    return __popc(ballot(flag) & ((1u << rank()) - 1));
  }
  __device__ uint32_t count(bool flag) const { return __popc(ballot(flag)); }
  __device__ uint32_t ballot(bool flag) const { return __ballot_sync(kAllLanes, flag); }
};

/// 8 lanes of a warp, side by side.
struct OctetTeam : DeviceTeam {
  static constexpr uint32_t kSize = 8;

  __device__ static uint32_t size() { return kSize; }
  __device__ static uint32_t rank() { return threadIdx.x % kSize; }
  __device__ static uint32_t lanes() { return 0xffu << (threadIdx.x % kWarp / kSize * kSize); }
  __device__ __forceinline__ void sync() const { __syncwarp(lanes()); }

  template <typename T, typename Op>
  __device__ T reduce(T value, const Op& op) const {
    for (uint32_t mask = kSize / 2; mask > 0; mask /= 2)
      value = op(value, shuffle_xor(value, mask, lanes()));
    __syncwarp(lanes());
    return value;
  }
};

/// All threads of a block, which are a multiple of a warp.
struct BlockTeam : DeviceTeam {
  static constexpr uint32_t kMostWarps = 32;

  __device__ static uint32_t size() { return blockDim.x; }
  __device__ static uint32_t rank() { return threadIdx.x; }
  __device__ __forceinline__ void sync() const { __syncthreads(); }

  template <typename T, typename Op>
  __device__ T reduce(const T& value, const Op& op) const {
    UMBEL_SHARED(unsigned char, bytes, kMostWarps * sizeof(T));
    T* of_warps = reinterpret_cast<T*>(bytes);
    const T of_warp = warp_reduce(value, op);
    __syncthreads();  // the last reduction's values may still be read
    if (rank() % kWarp == 0) of_warps[rank() / kWarp] = of_warp;
    __syncthreads();
    T result = of_warps[0];
    for (uint32_t w = 1; w < size() / kWarp; ++w) result = op(result, of_warps[w]);
    return result;
  }
  __device__ uint32_t rank_among(bool flag) const {
    uint32_t before, all;
    count_warps(flag, before, all);
    return before;
  }
  __device__ uint32_t count(bool flag) const {
    return static_cast<uint32_t>(__syncthreads_count(flag));
  }

 private:
  __device__ void count_warps(bool flag, uint32_t& before, uint32_t& all) const {
    UMBEL_SHARED(uint32_t, of_warps, kMostWarps);
    const uint32_t ballot = __ballot_sync(kAllLanes, flag);
    __syncthreads();
    if (rank() % kWarp == 0) of_warps[rank() / kWarp] = __popc(ballot);
    __syncthreads();
    before = __popc(ballot & ((1u << (rank() % kWarp)) - 1));
    all = 0;
    for (uint32_t w = 0; w < size() / kWarp; ++w) {
      if (w < rank() / kWarp) before += of_warps[w];
      all += of_warps[w];
    }
  }
};

}  // namespace umbel::cuda
