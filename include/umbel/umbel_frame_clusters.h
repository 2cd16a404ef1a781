// Clusters of meshes that change every frame, on the processor, from C: the twin of
// frame_clusters.hpp. umbel_cuda_clusters.h has the same on devices, with the same bytes. C99.
//
//   umbel_frame_config config;
//   umbel_frame_config_init(&config);
//   umbel_frame_clusterer* clusterer;
//   umbel_frame_clusterer_create(indices, triangle_count, vertex_count, &config, &clusterer);
//   umbel_frame_clusterer_build(clusterer, positions, vertex_count, 0, NULL);
//   umbel_frame_clusters clusters;
//   umbel_frame_clusterer_get(clusterer, &clusters);
//   ...
//   umbel_frame_clusterer_destroy(clusterer);
#ifndef UMBEL_UMBEL_FRAME_CLUSTERS_H
#define UMBEL_UMBEL_FRAME_CLUSTERS_H

#include "umbel/umbel_base.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum umbel_frame_method {
  UMBEL_FRAME_MORTON = 0,  ///< runs in Morton order: the fastest
  UMBEL_FRAME_HYBRID = 1,  ///< blocks of the Morton order, bisected: a third of the area
} umbel_frame_method;

typedef struct umbel_frame_config {
  uint32_t struct_size;
  uint32_t method;         ///< an umbel_frame_method; default UMBEL_FRAME_HYBRID
  uint32_t max_triangles;  ///< of a cluster, from 1 (hybrid: 2) to 512; default 128
  uint32_t min_triangles;  ///< hybrid: from 1 to max_triangles / 2; 0, the default: a quarter
  uint32_t max_vertices;   ///< of a cluster, from 3 to 256; default UMBEL_NO_LIMIT
  float underfill_cost;    ///< hybrid: penalty for missing triangles, from 0 to 4; default 1
  uint32_t code_bits;      ///< of Morton codes: 30, 63, or 0, the default: by the number
} umbel_frame_config;

/// Sets the first `size` bytes of a config to the defaults.
UMBEL_C_API void umbel_frame_config_init_sized(umbel_frame_config* config, size_t size);

static inline void umbel_frame_config_init(umbel_frame_config* config) {
  umbel_frame_config_init_sized(config, sizeof *config);
}

/// Most clusters that so many triangles can give.
UMBEL_C_API umbel_result umbel_frame_max_clusters(uint32_t triangles,
                                                  const umbel_frame_config* config,
                                                  uint32_t* clusters);

/// Clusters of one mesh through its frames.
typedef struct umbel_frame_clusterer umbel_frame_clusterer;

/// Copies the `3 * triangles` indices. `config` may be NULL. The caller destroys `clusterer`.
UMBEL_C_API umbel_result umbel_frame_clusterer_create(const uint32_t* indices, size_t triangles,
                                                      size_t vertices,
                                                      const umbel_frame_config* config,
                                                      umbel_frame_clusterer** clusterer);
/// NULL is none.
UMBEL_C_API void umbel_frame_clusterer_destroy(umbel_frame_clusterer* clusterer);

// Each of these takes one position a vertex, `position_stride` bytes from one to the next (0: one
// right after the other); `options` may be NULL. One call at a time for a clusterer.

/// Clusters of these positions alone, whatever came before.
UMBEL_C_API umbel_result umbel_frame_clusterer_build(umbel_frame_clusterer* clusterer,
                                                     const umbel_vec3* positions,
                                                     size_t position_count, size_t position_stride,
                                                     const umbel_build_options* options);
/// The same, but triangles with equal codes stay in the order of the last frame; faster.
UMBEL_C_API umbel_result umbel_frame_clusterer_update(umbel_frame_clusterer* clusterer,
                                                      const umbel_vec3* positions,
                                                      size_t position_count, size_t position_stride,
                                                      const umbel_build_options* options);
/// Keeps the clusters and computes their boxes again.
UMBEL_C_API umbel_result umbel_frame_clusterer_refit(umbel_frame_clusterer* clusterer,
                                                     const umbel_vec3* positions,
                                                     size_t position_count, size_t position_stride,
                                                     const umbel_build_options* options);
/// Refits, and rebuilds up to `clusters` of those whose areas have grown by the largest factors.
/// UMBEL_ERROR_INVALID_ARGUMENT with max_vertices.
UMBEL_C_API umbel_result umbel_frame_clusterer_rebuild_worst(
    umbel_frame_clusterer* clusterer, const umbel_vec3* positions, size_t position_count,
    size_t position_stride, uint32_t clusters, const umbel_build_options* options);

/// The clusters as they are. Arrays are the clusterer's, and last until its next call. Cluster c
/// has the triangles [offsets[c], offsets[c + 1]) of `items` and `indices`.
typedef struct umbel_frame_clusters {
  size_t cluster_count;
  size_t triangle_count;
  const uint32_t* items;       ///< one a triangle: its number in the mesh
  const uint32_t* indices;     ///< three a triangle: a new index buffer
  const uint32_t* offsets;     ///< cluster_count + 1
  const umbel_aabb* boxes;     ///< one a cluster
  double area_ratio;           ///< sum of the boxes' areas over that of the box of all
  double area_ratio_at_build;  ///< the same when each cluster was built
} umbel_frame_clusters;

UMBEL_C_API umbel_result umbel_frame_clusterer_get(const umbel_frame_clusterer* clusterer,
                                                   umbel_frame_clusters* clusters);

/// Each cluster's own vertices: how many there are in all, and, where arrays are given, `offsets`
/// (one more than clusters), `vertices` (room for `capacity`) and `corners` (three a triangle).
/// Fails where a cluster has more than 256 vertices, which max_vertices prevents.
UMBEL_C_API umbel_result umbel_frame_clusterer_vertices(const umbel_frame_clusterer* clusterer,
                                                        uint32_t* offsets, uint32_t* vertices,
                                                        uint8_t* corners, size_t capacity,
                                                        size_t* count,
                                                        const umbel_build_options* options);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_FRAME_CLUSTERS_H
