// Selection on CUDA devices, from C: the twin of cuda_select.hpp, which says what everything means.
// What cuda_types.hpp says of pointers, streams, scratch memory and errors holds here too; structs
// in device memory are those of umbel_lod.h.
//
//   uint32_t layers;
//   umbel_cuda_check_tables(&arrays, &layers);          // on the host, once
//   umbel_cuda_tables tables = {nodes, groups, clusters, NULL, group_count, layers};
//   umbel_cuda_scene scene = {view, planes, plane_count, instances, instance_count};
//   umbel_cuda_room room = {1 << 18, 1 << 18, 1 << 20};
//   size_t bytes = 0;
//   umbel_cuda_select(NULL, &bytes, &tables, &scene, NULL, &room, NULL, NULL, NULL);
//   cudaMalloc(&scratch, bytes);
//   umbel_cuda_select(scratch, &bytes, &tables, &scene, NULL, &room, &selection, NULL, stream);
#ifndef UMBEL_UMBEL_CUDA_SELECT_H
#define UMBEL_UMBEL_CUDA_SELECT_H

#include "umbel/umbel_lod.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A mesh's tables, in device memory.
typedef struct umbel_cuda_tables {
  const umbel_lod_node* nodes;
  const umbel_lod_group* groups;
  const umbel_lod_cluster* clusters;
  const umbel_cluster_bounds* normal_cones;  ///< one a cluster, or NULL
  uint32_t group_count;
  uint32_t layers;  ///< from umbel_cuda_check_tables
} umbel_cuda_tables;

/// Checks tables in host memory, and counts the layers of their hierarchy.
UMBEL_C_API umbel_result umbel_cuda_check_tables(const umbel_lod_arrays* arrays, uint32_t* layers);

/// What is seen, in device memory.
typedef struct umbel_cuda_scene {
  const umbel_lod_view* view;  ///< one
  const umbel_plane* planes;   ///< may be NULL
  uint32_t plane_count;
  const umbel_transform* instances;
  uint32_t instance_count;
} umbel_cuda_scene;

/// What of an asset is in memory, in device memory.
typedef struct umbel_cuda_pages {
  const uint32_t* page_of_group;
  const uint8_t* resident;  ///< one a page: 1 where it is in memory
  uint32_t* states;         ///< one a group, from umbel_cuda_mark_resident_groups
  uint32_t page_count;
} umbel_cuda_pages;

/// `levels` are in host memory.
UMBEL_C_API umbel_result umbel_cuda_mark_resident_groups(
    void* scratch, size_t* scratch_bytes, const umbel_cuda_tables* tables,
    const umbel_range* levels, uint32_t level_count, const umbel_cuda_pages* pages, void* stream);

typedef struct umbel_cuda_room {
  uint32_t queue, groups, clusters;
} umbel_cuda_room;

typedef struct umbel_cuda_counts {
  uint32_t queue, groups, clusters;
  uint32_t requests;
  uint32_t refused;
  uint32_t overflow;  ///< bits 1, 2, 4: the room for queue, groups, clusters was too small
} umbel_cuda_counts;

/// The cuts, in device memory.
typedef struct umbel_cuda_selection {
  uint32_t* offsets;   ///< one more than instances
  uint32_t* clusters;  ///< room.clusters
  umbel_cuda_counts* counts;
} umbel_cuda_selection;

/// What the cuts want of the asset, in device memory; either may be NULL.
typedef struct umbel_cuda_feedback {
  float* urgencies;    ///< one a page
  uint32_t* requests;  ///< room for one a page
} umbel_cuda_feedback;

/// Writes a view of the host into device memory, in the stream, without waiting.
UMBEL_C_API umbel_result umbel_cuda_put_view(const umbel_lod_view* view, umbel_lod_view* to,
                                             void* stream);

/// `pages` and `feedback` may be NULL: then everything is there. `out` may be while `scratch` is.
UMBEL_C_API umbel_result umbel_cuda_select(
    void* scratch, size_t* scratch_bytes, const umbel_cuda_tables* tables,
    const umbel_cuda_scene* scene, const umbel_cuda_pages* pages, const umbel_cuda_room* room,
    const umbel_cuda_selection* out, const umbel_cuda_feedback* feedback, void* stream);

#ifdef __cplusplus
}
#endif

#endif
