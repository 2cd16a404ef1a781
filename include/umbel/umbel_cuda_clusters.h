// Clusters of meshes that change every frame, on CUDA devices, from C: the twin of
// cuda_clusters.hpp.
//
//   umbel_frame_config config;
//   umbel_frame_config_init(&config);
//   umbel_cuda_mesh mesh = {positions, 12, indices, NULL, triangle_count};
//   size_t bytes = 0;
//   umbel_cuda_build_frame_clusters(NULL, &bytes, &mesh, &config, NULL, NULL);
//   cudaMalloc(&scratch, bytes);
//   umbel_cuda_build_frame_clusters(scratch, &bytes, &mesh, &config, &clusters, stream);
#ifndef UMBEL_UMBEL_CUDA_CLUSTERS_H
#define UMBEL_UMBEL_CUDA_CLUSTERS_H

#include "umbel/umbel_cuda_types.h"
#include "umbel/umbel_frame_clusters.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Clusters of a frame, in device memory. Cluster c has triangles [offsets[c], offsets[c + 1]).
typedef struct umbel_cuda_clusters {
  uint32_t* items;    ///< one a triangle, in cluster order
  uint32_t* indices;  ///< three a triangle, in cluster order
  uint32_t* offsets;  ///< room for one more than the most clusters
  umbel_aabb* boxes;  ///< room for the most clusters
  uint32_t* count;    ///< one: how many clusters there are
} umbel_cuda_clusters;

/// Areas of clusters: shares of the area of the box of all, times 2^40, in device memory.
typedef struct umbel_cuda_area_growth {
  uint64_t* now;       ///< room for the most clusters
  uint64_t* at_build;  ///< the same
  uint64_t* total;     ///< two: the sums of both
} umbel_cuda_area_growth;

/// Each cluster's own vertices, in device memory.
typedef struct umbel_cuda_vertex_lists {
  uint32_t* offsets;   ///< room for one more than the most clusters
  uint32_t* vertices;  ///< room for three a triangle
  uint8_t* corners;    ///< three a triangle
} umbel_cuda_vertex_lists;

// As the functions of these names in cuda_clusters.hpp. `stream` is a cudaStream_t. With `scratch`
// NULL, only `scratch_bytes` is set, and of the structs only sizes are read; clusters, growth and
// lists may be NULL then.

UMBEL_C_API umbel_result umbel_cuda_build_frame_clusters(void* scratch, size_t* scratch_bytes,
                                                         const umbel_cuda_mesh* mesh,
                                                         const umbel_frame_config* config,
                                                         const umbel_cuda_clusters* out,
                                                         void* stream);

UMBEL_C_API umbel_result umbel_cuda_measure_frame_clusters(void* scratch, size_t* scratch_bytes,
                                                           uint32_t triangles,
                                                           const umbel_frame_config* config,
                                                           const umbel_cuda_clusters* clusters,
                                                           const umbel_cuda_area_growth* growth,
                                                           int is_new, void* stream);

UMBEL_C_API umbel_result umbel_cuda_refit_frame_clusters(void* scratch, size_t* scratch_bytes,
                                                         const umbel_cuda_mesh* mesh,
                                                         const umbel_frame_config* config,
                                                         const umbel_cuda_clusters* clusters,
                                                         const umbel_cuda_area_growth* growth,
                                                         void* stream);

UMBEL_C_API umbel_result umbel_cuda_rebuild_worst_frame_clusters(
    void* scratch, size_t* scratch_bytes, const umbel_cuda_mesh* mesh,
    const umbel_frame_config* config, uint32_t budget, const umbel_cuda_clusters* clusters,
    const umbel_cuda_area_growth* growth, const umbel_cuda_clusters* out,
    const umbel_cuda_area_growth* out_growth, void* stream);

UMBEL_C_API umbel_result umbel_cuda_list_frame_vertices(
    void* scratch, size_t* scratch_bytes, uint32_t triangles, const umbel_frame_config* config,
    const umbel_cuda_clusters* clusters, const umbel_cuda_vertex_lists* out, void* stream);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_CUDA_CLUSTERS_H
