// Structures that divide triangles uniformly, without weighing costs, from C: two-level grids,
// octrees and bounding interval hierarchies. They build about as fast as a sort. C99.
//
//   umbel_uniform_config config;
//   umbel_uniform_config_init(&config);
//   config.structure = UMBEL_UNIFORM_OCTREE;
//   umbel_uniform* octree;
//   if (umbel_uniform_build(&mesh, &config, NULL, &octree) != UMBEL_OK) puts(umbel_last_error());
//   umbel_uniform_intersect(octree, rays, ray_count, NULL, hits);
//   umbel_uniform_free(octree);
//
// The mesh, rays and options are those of BVHs (umbel_bvh.h), and so are the hits, bit by bit. An
// umbel_uniform copies all that it needs from the mesh. Any number of threads may query one at
// once.
#ifndef UMBEL_UMBEL_UNIFORM_H
#define UMBEL_UMBEL_UNIFORM_H

#include "umbel/umbel_kdtree.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum umbel_uniform_structure {
  UMBEL_UNIFORM_GRID = 0,      ///< a grid whose cells hold grids
  UMBEL_UNIFORM_OCTREE = 1,    ///< a cube that is cut into eight, again and again
  UMBEL_UNIFORM_INTERVALS = 2  ///< the bounding interval hierarchy
} umbel_uniform_structure;

/// How to build. Ranges in brackets; each structure reads its own fields.
typedef struct umbel_uniform_config {
  uint32_t struct_size;
  uint32_t structure;      ///< umbel_uniform_structure
  float density;           ///< [0.001, 16] grid: cells a triangle of the top level
  float leaf_density;      ///< [0.001, 16] grid: cells of a cell's own grid for each triangle there
  float max_references;    ///< [1, 64] grid, octree: most references a triangle
  uint32_t max_leaf_size;  ///< [1, 64] octree, intervals: so few triangles are not cut any more;
                           ///< 0: 8 of an octree, 4 of intervals
  uint32_t max_depth;      ///< [1, 20] octree; 0: 6 + log4(triangles)
  uint32_t drop_invalid;   ///< nonzero: leave out triangles with a NaN or infinite vertex
  uint32_t compact;        ///< nonzero: triangles share vertices; less memory, slower rays
  uint32_t simd;           ///< umbel_simd: what queries use; results are the same for all
  float traversal_cost;    ///< [> 0] for the statistics
  float intersection_cost;  ///< [> 0] for the statistics
} umbel_uniform_config;

typedef struct umbel_uniform umbel_uniform;

/// Sets the first `size` bytes of a config to the defaults: those of a grid.
UMBEL_C_API void umbel_uniform_config_init_sized(umbel_uniform_config* config, size_t size);

static inline void umbel_uniform_config_init(umbel_uniform_config* config) {
  umbel_uniform_config_init_sized(config, sizeof *config);
}

/// As umbel_bvh_build. `config` (the defaults) and `options` may be NULL. `*structure` is NULL on
/// failure, else to be freed.
UMBEL_C_API umbel_result umbel_uniform_build(const umbel_bvh_mesh* mesh,
                                             const umbel_uniform_config* config,
                                             const umbel_build_options* options,
                                             umbel_uniform** structure);

/// NULL is legal.
UMBEL_C_API void umbel_uniform_free(umbel_uniform* structure);

/// Leaves are the cells of a grid; see umbel_kdtree_statistics.
UMBEL_C_API umbel_result umbel_uniform_get_statistics(const umbel_uniform* structure,
                                                      umbel_kdtree_statistics* statistics);

// Queries: each as that of umbel_bvh in umbel_bvh.h.

UMBEL_C_API umbel_result umbel_uniform_intersect(const umbel_uniform* structure,
                                                 const umbel_ray* rays, size_t count,
                                                 const umbel_ray_options* options, umbel_hit* hits);
UMBEL_C_API umbel_result umbel_uniform_occluded(const umbel_uniform* structure,
                                                const umbel_ray* rays, size_t count,
                                                const umbel_ray_options* options, uint8_t* results);
UMBEL_C_API umbel_result umbel_uniform_all_hits(const umbel_uniform* structure,
                                                const umbel_ray* rays, size_t count,
                                                const umbel_ray_options* options,
                                                size_t hits_per_ray, umbel_hit* hits,
                                                uint32_t* hit_counts);
UMBEL_C_API umbel_result umbel_uniform_closest_point(const umbel_uniform* structure,
                                                     const umbel_vec3* points, size_t count,
                                                     float max_distance, uint32_t threads,
                                                     umbel_closest_point* results);
UMBEL_C_API umbel_result umbel_uniform_contains(const umbel_uniform* structure,
                                                const umbel_vec3* points, size_t count,
                                                uint32_t threads, uint8_t* results);
UMBEL_C_API umbel_result umbel_uniform_signed_distance(const umbel_uniform* structure,
                                                       const umbel_vec3* points, size_t count,
                                                       uint32_t threads, float* results);
UMBEL_C_API umbel_result umbel_uniform_overlaps_box(const umbel_uniform* structure,
                                                    const umbel_aabb* box, uint32_t* triangles,
                                                    size_t capacity, size_t* count);
UMBEL_C_API umbel_result umbel_uniform_overlaps_sphere(const umbel_uniform* structure,
                                                       const umbel_sphere* sphere,
                                                       uint32_t* triangles, size_t capacity,
                                                       size_t* count);
UMBEL_C_API umbel_result umbel_uniform_overlaps_frustum(const umbel_uniform* structure,
                                                        const umbel_plane* planes,
                                                        uint32_t* triangles, size_t capacity,
                                                        size_t* count);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_UNIFORM_H
