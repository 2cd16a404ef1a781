// Hierarchies over the clusters of a frame, on CUDA devices, from C: the twin of
// cuda_cluster_bvh.hpp.
#ifndef UMBEL_UMBEL_CUDA_CLUSTER_BVH_H
#define UMBEL_UMBEL_CUDA_CLUSTER_BVH_H

#include "umbel/umbel_cuda_bvh.h"
#include "umbel/umbel_cuda_clusters.h"

#ifdef __cplusplus
extern "C" {
#endif

/// As build_cluster_bvh in cuda_cluster_bvh.hpp. With `scratch` NULL, only `scratch_bytes` is set,
/// and `clusters` and `out` may be NULL.
UMBEL_C_API umbel_result umbel_cuda_build_cluster_bvh(void* scratch, size_t* scratch_bytes,
                                                      const umbel_cuda_mesh* mesh,
                                                      const umbel_frame_config* cluster_config,
                                                      const umbel_cuda_clusters* clusters,
                                                      const umbel_cuda_bvh_config* config,
                                                      const umbel_cuda_bvh* out, void* stream);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_CUDA_CLUSTER_BVH_H
