// Arrays on the device for tests: filled with rubbish, with a guard behind them that must survive.
#pragma once

#include <cuda_runtime.h>
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "cuda/status.cuh"

namespace umbel::cuda {

/// Whether the device is the one of tests/simt, for which meshes must be small.
#if defined(UMBEL_SIMT)
inline constexpr bool kEmulated = true;
#else
inline constexpr bool kEmulated = false;
#endif

inline bool has_device() {
  int count = 0;
  const bool found = cudaGetDeviceCount(&count) == cudaSuccess && count > 0;
  cudaGetLastError();
  return found;
}

/// Tests of this fixture need a device; they are built where there is none.
class OnDevice : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_device()) GTEST_SKIP() << "there is no CUDA device here";
  }
};

template <typename T>
class DeviceArray {
 public:
  explicit DeviceArray(size_t size) : size_(size) {
    check(cudaMalloc(&memory_, bytes() + kGuard), "allocating on the device");
    check(cudaMemset(memory_, 0xa5, bytes() + kGuard), "filling device memory");
    settle();
  }
  explicit DeviceArray(const std::vector<T>& values) : DeviceArray(values.size()) { write(values); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;
  ~DeviceArray() {
    std::vector<unsigned char> guard(kGuard), expected(kGuard, 0xa5);
    cudaMemcpy(guard.data(), reinterpret_cast<char*>(memory_) + bytes(), kGuard,
               cudaMemcpyDeviceToHost);
    EXPECT_EQ(guard, expected) << "something was written behind an array";
    cudaFree(memory_);
  }

  T* data() const { return memory_; }
  size_t size() const { return size_; }
  std::vector<T> read() const { return read(size_); }
  std::vector<T> read(size_t count) const {
    std::vector<T> values(count);
    check(cudaDeviceSynchronize(), "waiting for the device");
    check(cudaMemcpy(values.data(), memory_, count * sizeof(T), cudaMemcpyDeviceToHost), "copying");
    return values;
  }
  void write(const std::vector<T>& values) {
    check(cudaMemcpy(memory_, values.data(), values.size() * sizeof(T), cudaMemcpyHostToDevice),
          "copying");
    settle();
  }

 private:
  static constexpr size_t kGuard = 256;
  /// Neither a copy from pageable memory nor a fill is done when its call returns, and streams that
  /// do not block wait for neither.
  static void settle() { check(cudaDeviceSynchronize(), "waiting for the device"); }
  size_t bytes() const { return (size_ > 0 ? size_ : 1) * sizeof(T); }

  size_t size_;
  T* memory_ = nullptr;
};

/// Asks for the scratch memory, and then calls with exactly that.
template <typename Call>
void with_scratch(const Call& call) {
  size_t bytes = 0;
  call(nullptr, bytes);
  const DeviceArray<unsigned char> scratch(bytes);
  call(scratch.data(), bytes);
  check(cudaDeviceSynchronize(), "waiting for the device");
}

/// Whether two arrays are the same bytes.
template <typename T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

}  // namespace umbel::cuda
