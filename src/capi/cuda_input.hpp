// What the functions of umbel_cuda.h take, as cuda.hpp takes it.
#pragma once

#include <string>

#include "umbel/cuda.hpp"
#include "umbel/umbel_cuda.h"

namespace umbel::capi {

[[noreturn]] inline void refuse_null(const char* name) {
  throw Error(ErrorCode::kInvalidArgument, std::string(name) + " must not be NULL");
}

template <typename T>
const T& not_null(const T* pointer, const char* name) {
  if (!pointer) refuse_null(name);
  return *pointer;
}

inline size_t& bytes_of(size_t* scratch_bytes) {
  if (!scratch_bytes) refuse_null("scratch_bytes");
  return *scratch_bytes;
}

inline cuda::DeviceMesh mesh_of(const umbel_cuda_mesh* given) {
  const umbel_cuda_mesh& m = not_null(given, "mesh");
  return {m.positions, m.position_stride, m.indices, m.items, m.triangles};
}

inline cuda::Stream stream_of(void* stream) { return static_cast<cuda::Stream>(stream); }

}  // namespace umbel::capi
