// Kd-trees from C. C99.
//
//   umbel_kdtree* tree;
//   if (umbel_kdtree_build(&mesh, NULL, NULL, &tree) != UMBEL_OK) puts(umbel_last_error());
//   umbel_kdtree_intersect(tree, rays, ray_count, NULL, hits);
//   umbel_kdtree_free(tree);
//
// The mesh, rays and options are those of BVHs (umbel_bvh.h), and so are the hits, bit by bit. An
// umbel_kdtree copies all that it needs from the mesh. Any number of threads may query one at once;
// umbel_kdtree_set_traversal and umbel_kdtree_free need exclusive access.
#ifndef UMBEL_UMBEL_KDTREE_H
#define UMBEL_UMBEL_KDTREE_H

#include "umbel/umbel_bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum umbel_kdtree_builder {
  UMBEL_KDTREE_EXACT = 0,  ///< every plane that could be best is considered
  UMBEL_KDTREE_BINNED = 1  ///< planes between bins, until few triangles are left
} umbel_kdtree_builder;

/// How rays traverse the tree. All give the same hits.
typedef enum umbel_kdtree_traversal {
  UMBEL_KDTREE_STACK = 0,
  UMBEL_KDTREE_ROPES = 1,
  UMBEL_KDTREE_SHORT_STACK = 2
} umbel_kdtree_traversal;

/// How to build and trace. Ranges in brackets.
typedef struct umbel_kdtree_config {
  uint32_t struct_size;
  uint32_t builder;         ///< umbel_kdtree_builder
  float traversal_cost;     ///< [> 0] of visiting an inner node, in any unit
  float intersection_cost;  ///< [> 0] of testing a triangle
  float empty_bonus;        ///< [0, 0.9] cutting off empty space is that much cheaper
  uint32_t max_depth;       ///< [1, 64]; 0: 8 + 1.3 log2(triangles)
  uint32_t bad_refines;     ///< [0, 64] splits on one path that may cost more than a leaf
  float max_references;     ///< [1, 64] most references a triangle, which bounds memory
  uint32_t bins;            ///< [4, 256] binned: bins an axis
  uint32_t drop_invalid;    ///< nonzero: leave out triangles with a NaN or infinite vertex
  uint32_t traversal;       ///< umbel_kdtree_traversal
  uint32_t compact;         ///< nonzero: triangles share vertices; less memory, slower rays
  uint32_t simd;            ///< umbel_simd: what queries use; results are the same for all
  uint32_t
      target_leaf_size;  ///< [0, 255] so few triangles are not split any more; 0: by cost alone
} umbel_kdtree_config;

typedef struct umbel_kdtree_statistics {
  uint32_t struct_size;
  uint32_t nodes;  ///< inner nodes and leaves
  uint32_t leaves;
  uint32_t empty_leaves;
  uint32_t max_depth;
  uint32_t triangle_count;  ///< of the mesh, dropped ones included
  uint64_t references;      ///< of all leaves, also where they share a list
  double sah_cost;
  double inner_visits;  ///< inner nodes that a random line through the bounds is expected to visit
  double leaf_visits;   ///< leaves that it visits
  double tests;         ///< references in those leaves
  uint64_t bytes;       ///< everything that a query may touch
  umbel_aabb bounds;    ///< min > max where there are no triangles
} umbel_kdtree_statistics;
UMBEL_STRUCT_INIT(umbel_kdtree_statistics)

typedef struct umbel_kdtree umbel_kdtree;

/// Sets the first `size` bytes of a config to the defaults.
UMBEL_C_API void umbel_kdtree_config_init_sized(umbel_kdtree_config* config, size_t size);

static inline void umbel_kdtree_config_init(umbel_kdtree_config* config) {
  umbel_kdtree_config_init_sized(config, sizeof *config);
}

/// As umbel_bvh_build. `config` (the defaults) and `options` may be NULL. `*tree` is NULL on
/// failure, else to be freed.
UMBEL_C_API umbel_result umbel_kdtree_build(const umbel_bvh_mesh* mesh,
                                            const umbel_kdtree_config* config,
                                            const umbel_build_options* options,
                                            umbel_kdtree** tree);

/// NULL is legal.
UMBEL_C_API void umbel_kdtree_free(umbel_kdtree* tree);

/// `traversal` is an umbel_kdtree_traversal. Ropes are made when first asked for.
UMBEL_C_API umbel_result umbel_kdtree_set_traversal(umbel_kdtree* tree, uint32_t traversal);

/// Writes a .umkd file beside `path`, then renames. Ropes are not stored.
UMBEL_C_API umbel_result umbel_kdtree_save(const umbel_kdtree* tree, const char* path);
/// Reads a .umkd file; UMBEL_ERROR_CORRUPT if it is damaged. `*tree` is NULL on failure, else to be
/// freed.
UMBEL_C_API umbel_result umbel_kdtree_load(const char* path, uint32_t traversal,
                                           umbel_kdtree** tree);

UMBEL_C_API umbel_result umbel_kdtree_get_statistics(const umbel_kdtree* tree,
                                                     umbel_kdtree_statistics* statistics);

// Queries: each as that of umbel_bvh in umbel_bvh.h.

UMBEL_C_API umbel_result umbel_kdtree_intersect(const umbel_kdtree* tree, const umbel_ray* rays,
                                                size_t count, const umbel_ray_options* options,
                                                umbel_hit* hits);
UMBEL_C_API umbel_result umbel_kdtree_occluded(const umbel_kdtree* tree, const umbel_ray* rays,
                                               size_t count, const umbel_ray_options* options,
                                               uint8_t* results);
UMBEL_C_API umbel_result umbel_kdtree_all_hits(const umbel_kdtree* tree, const umbel_ray* rays,
                                               size_t count, const umbel_ray_options* options,
                                               size_t hits_per_ray, umbel_hit* hits,
                                               uint32_t* hit_counts);
UMBEL_C_API umbel_result umbel_kdtree_closest_point(const umbel_kdtree* tree,
                                                    const umbel_vec3* points, size_t count,
                                                    float max_distance, uint32_t threads,
                                                    umbel_closest_point* results);
UMBEL_C_API umbel_result umbel_kdtree_contains(const umbel_kdtree* tree, const umbel_vec3* points,
                                               size_t count, uint32_t threads, uint8_t* results);
UMBEL_C_API umbel_result umbel_kdtree_signed_distance(const umbel_kdtree* tree,
                                                      const umbel_vec3* points, size_t count,
                                                      uint32_t threads, float* results);
UMBEL_C_API umbel_result umbel_kdtree_overlaps_box(const umbel_kdtree* tree, const umbel_aabb* box,
                                                   uint32_t* triangles, size_t capacity,
                                                   size_t* count);
UMBEL_C_API umbel_result umbel_kdtree_overlaps_sphere(const umbel_kdtree* tree,
                                                      const umbel_sphere* sphere,
                                                      uint32_t* triangles, size_t capacity,
                                                      size_t* count);
UMBEL_C_API umbel_result umbel_kdtree_overlaps_frustum(const umbel_kdtree* tree,
                                                       const umbel_plane* planes,
                                                       uint32_t* triangles, size_t capacity,
                                                       size_t* count);

// ---- kd-trees over boxes -----------------------------------------------------------------------
//
//   float nearest_sphere(void* user, const uint32_t* primitives, size_t count) {
//     struct search* s = user;
//     for (size_t i = 0; i < count; ++i) test(s, primitives[i]);   // lowers s->nearest
//     return s->nearest;
//   }
//   ...
//   umbel_box_kdtree_build(boxes_of_spheres, count, NULL, NULL, &tree);
//   umbel_box_kdtree_traverse(tree, &ray, nearest_sphere, &search, NULL);
//   umbel_box_kdtree_free(tree);

/// A kd-tree over the boxes of the caller's own primitives, which the caller tests.
typedef struct umbel_box_kdtree umbel_box_kdtree;

/// `boxes` (finite, min <= max) are not needed afterwards. `config` (the defaults) and `options`
/// may be NULL; of the config what queries use means nothing. `*tree` is NULL on failure, else to
/// be freed.
UMBEL_C_API umbel_result umbel_box_kdtree_build(const umbel_aabb* boxes, size_t box_count,
                                                const umbel_kdtree_config* config,
                                                const umbel_build_options* options,
                                                umbel_box_kdtree** tree);
/// NULL is legal.
UMBEL_C_API void umbel_box_kdtree_free(umbel_box_kdtree* tree);

/// Of `triangle_count`, boxes.
UMBEL_C_API umbel_result umbel_box_kdtree_get_statistics(const umbel_box_kdtree* tree,
                                                         umbel_kdtree_statistics* statistics);

/// Tests the primitives of a leaf, `count` of them. What it returns is the limit from then on:
/// cells that the ray enters behind it are not visited, and the limit never rises. One below the
/// ray's t_min ends the traversal.
typedef float (*umbel_kdtree_visit)(void* user, const uint32_t* primitives, size_t count);

/// Visits the leaves that a ray passes through, from near to far. A primitive may lie in several
/// leaves. `*limit` (may be NULL) is the last limit, or t_max.
UMBEL_C_API umbel_result umbel_box_kdtree_traverse(const umbel_box_kdtree* tree,
                                                   const umbel_ray* ray, umbel_kdtree_visit visit,
                                                   void* user, float* limit);

/// The primitives whose boxes touch a box, as umbel_kdtree_overlaps_box gives triangles.
UMBEL_C_API umbel_result umbel_box_kdtree_overlaps_box(const umbel_box_kdtree* tree,
                                                       const umbel_aabb* box, uint32_t* primitives,
                                                       size_t capacity, size_t* count);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_KDTREE_H
