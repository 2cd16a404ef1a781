// What the functions of umbel_cuda_*.h take, as those of cuda_*.hpp take it.
#pragma once

#include <string>

#include "capi/arguments.hpp"
#include "umbel/cuda_cluster_bvh.hpp"
#include "umbel/umbel_cuda_cluster_bvh.h"

namespace umbel::capi {

inline cuda::DeviceMesh mesh_of(const umbel_cuda_mesh* given) {
  const umbel_cuda_mesh& m = required(given, "mesh");
  return {m.positions, m.position_stride, m.indices, m.items, m.triangles};
}

/// A config that its function `init` has filled.
template <typename T>
const T& sized_config(const T* given, const char* init) {
  const T& config = required(given, "config");
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
  const umbel_cuda_bvh& b = required(given, name);
  return {static_cast<bvh::CompactNode*>(b.nodes), static_cast<bvh::CompactTriangle*>(b.triangles),
          reinterpret_cast<bvh::CompactInfo*>(b.info)};
}

cuda::DeviceBvhConfig bvh_config_of(const umbel_cuda_bvh_config* given);

/// Only looked at when there is work to do.
inline cuda::DeviceClusters clusters_of(const umbel_cuda_clusters* given, const void* scratch,
                                        const char* name) {
  if (!given && !scratch) return {};
  const umbel_cuda_clusters& c = required(given, name);
  return {c.items, c.indices, c.offsets, reinterpret_cast<Aabb*>(c.boxes), c.count};
}

inline cuda::Stream stream_of(void* stream) { return static_cast<cuda::Stream>(stream); }

}  // namespace umbel::capi
