// What the functions of umbel_cuda_*.h take, as those of cuda_*.hpp take it.
#pragma once

#include "capi/arguments.hpp"
#include "umbel/cuda_cluster_bvh.hpp"
#include "umbel/umbel_cuda_cluster_bvh.h"

namespace umbel::capi {

inline cuda::DeviceMesh mesh_of(const umbel_cuda_mesh* given) {
  const umbel_cuda_mesh& m = required(given, "mesh");
  return {m.positions, m.position_stride, m.indices, m.items, m.triangles};
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
