// What CUDA says, as umbel::Error.
#pragma once

#include <cuda_runtime.h>

#include <string>

#include "umbel/types.hpp"

namespace umbel::cuda {

/// Throws kDevice unless a call succeeded.
inline void check(cudaError_t status, const char* what) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // or the next call that asks would see it again
  throw Error(ErrorCode::kDevice, std::string(what) + ": CUDA says: " + cudaGetErrorString(status) +
                                      " (" + cudaGetErrorName(status) + ")");
}

}  // namespace umbel::cuda
