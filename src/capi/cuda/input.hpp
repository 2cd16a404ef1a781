// What the functions of umbel_cuda.h take, as cuda.hpp takes it.
#pragma once

#include <string>

#include "umbel/cuda_bvh.hpp"
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

/// A config that its function `init` has filled.
template <typename T>
const T& sized_config(const T* given, const char* init) {
  const T& config = not_null(given, "config");
  if (config.struct_size != sizeof config)
    throw Error(ErrorCode::kUnsupported,
                "config has a struct_size of " + std::to_string(config.struct_size) + ", not " +
                    std::to_string(sizeof config) + ": " + init + " sets it");
  return config;
}

/// Only looked at when there is work to do.
inline cuda::DeviceBvh bvh_of(const umbel_cuda_bvh* given, const void* scratch,
                              const char* name = "bvh") {
  if (!given && !scratch) return {};
  const umbel_cuda_bvh& b = not_null(given, name);
  return {static_cast<bvh::CompactNode*>(b.nodes), static_cast<bvh::CompactTriangle*>(b.triangles),
          reinterpret_cast<bvh::CompactInfo*>(b.info)};
}

inline cuda::Stream stream_of(void* stream) { return static_cast<cuda::Stream>(stream); }

}  // namespace umbel::capi
