// Makes the device that holds some memory the current one, and the one before it again at the end
// of the scope. Kernels, CUB's questions and the default stream go to the current device.
#pragma once

#include <cuda_runtime.h>

#include "cuda/status.cuh"

namespace umbel::cuda {

class DeviceGuard {
 public:
  /// Memory of no device, or null, changes nothing. Managed memory does neither: any device may
  /// work on it.
  explicit DeviceGuard(const void* place) {
    cudaPointerAttributes found{};
    if (!place || cudaPointerGetAttributes(&found, place) != cudaSuccess) {
      cudaGetLastError();  // or the next call that asks would see it
      return;
    }
    if (found.type != cudaMemoryTypeDevice) return;
    int current = 0;
    check(cudaGetDevice(&current), "asking for the device");
    if (current == found.device) return;
    check(cudaSetDevice(found.device), "changing the device");
    before_ = current;
  }
  DeviceGuard(const DeviceGuard&) = delete;
  DeviceGuard& operator=(const DeviceGuard&) = delete;
  ~DeviceGuard() {
    if (before_ >= 0) cudaSetDevice(before_);
  }

 private:
  int before_ = -1;
};

}  // namespace umbel::cuda
