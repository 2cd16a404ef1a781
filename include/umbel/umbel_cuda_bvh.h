// Bounding volume hierarchies built on CUDA devices, from C: the twin of cuda_bvh.hpp. Nodes of 80
// bytes and triangles of 48 are those of compact_bvh.hpp, which describes every byte of them.
//
//   umbel_cuda_bvh_config config;
//   umbel_cuda_bvh_config_init(&config, "hploc");
//   umbel_cuda_build_bvh(NULL, &bytes, &mesh, &config, NULL, NULL);
//   cudaMalloc(&scratch, bytes);
//   umbel_cuda_build_bvh(scratch, &bytes, &mesh, &config, &bvh, stream);
#ifndef UMBEL_UMBEL_CUDA_BVH_H
#define UMBEL_UMBEL_CUDA_BVH_H

#include "umbel/umbel_cuda_types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct umbel_cuda_bvh_config {
  uint32_t struct_size;
  uint32_t builder;            ///< 0 lbvh, 1 hlbvh, 2 atrbvh, 3 ploc, 4 hploc, 5 kmeans, 6 sweep
  float traversal_cost;        ///< of SAH; default 3
  float intersection_cost;     ///< default 2
  uint32_t max_leaf_size;      ///< from 1 to 8; default 8
  float presplit;              ///< from 0, the default, to 1: parts of triangles, as a share
  uint32_t hlbvh_bits;         ///< hlbvh: from 3 to 30; default 15
  uint32_t treelet_size;       ///< atrbvh: from 3 to 15; default 9
  uint32_t treelet_rounds;     ///< atrbvh: from 1 to 16; default 2
  uint32_t ploc_radius;        ///< ploc, hploc: from 1 to 128; default 16
  uint32_t kmeans_clusters;    ///< kmeans: k, from 2 to 64; default 8
  uint32_t kmeans_candidates;  ///< p, from 1 to 64; default 5
  uint32_t kmeans_iterations;  ///< i, from 0 to 100; default 2
  uint32_t kmeans_manhattan;   ///< nonzero: medians; default 0
  uint32_t kmeans_forwarded_clusters;  ///< from 0, the default, to 64; 1 as published
} umbel_cuda_bvh_config;

/// Sets the first `size` bytes of a config to the defaults of a builder: "lbvh", "hlbvh", "atrbvh",
/// "ploc", "hploc", "kmeans", "kmeans-q1" to "kmeans-q5" or "sweep"; NULL means "hploc". `size` is
/// sizeof(umbel_cuda_bvh_config) as the caller was compiled with it. Leaves the config as it is on
/// failure.
UMBEL_C_API umbel_result umbel_cuda_bvh_config_init_sized(umbel_cuda_bvh_config* config,
                                                          size_t size, const char* builder);

static inline umbel_result umbel_cuda_bvh_config_init(umbel_cuda_bvh_config* config,
                                                      const char* builder) {
  return umbel_cuda_bvh_config_init_sized(config, sizeof *config, builder);
}

/// What holds of a whole tree, in device memory.
typedef struct umbel_compact_info {
  uint32_t nodes;
  uint32_t triangles;
  umbel_aabb bounds;
  float sah_cost;
  float reserved;
} umbel_compact_info;

/// A tree, in device memory.
typedef struct umbel_cuda_bvh {
  void* nodes;      ///< room for node_capacity nodes of 80 bytes; aligned to 16
  void* triangles;  ///< triangle_capacity of 48 bytes; aligned to 16
  umbel_compact_info* info;
} umbel_cuda_bvh;

/// Room that a tree over so many triangles needs.
UMBEL_C_API umbel_result umbel_cuda_bvh_capacity(uint32_t triangles,
                                                 const umbel_cuda_bvh_config* config,
                                                 uint32_t* node_capacity,
                                                 uint32_t* triangle_capacity);

/// ploc and kmeans wait for the stream while they build; the others do not.
UMBEL_C_API umbel_result umbel_cuda_build_bvh(void* scratch, size_t* scratch_bytes,
                                              const umbel_cuda_mesh* mesh,
                                              const umbel_cuda_bvh_config* config,
                                              const umbel_cuda_bvh* out, void* stream);

/// For new positions of the mesh, which must have had no `items`.
UMBEL_C_API umbel_result umbel_cuda_refit_bvh(void* scratch, size_t* scratch_bytes,
                                              const umbel_cuda_mesh* mesh,
                                              const umbel_cuda_bvh_config* config,
                                              const umbel_cuda_bvh* bvh, void* stream);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_CUDA_BVH_H
