// Binary trees over boxes that are inserted, moved and removed one at a time, from C: for scenes in
// which objects move, appear and vanish. C99.
//
//   umbel_dynamic_tree* tree;
//   uint32_t door;
//   if (umbel_dynamic_tree_build(NULL, 0, NULL, NULL, &tree) != UMBEL_OK) puts(umbel_last_error());
//   umbel_dynamic_tree_insert(tree, &box_of_door, &door);
//   umbel_dynamic_tree_move(tree, door, &box_of_open_door);
//   umbel_dynamic_tree_overlaps_box(tree, &region, NULL, 0, &count);
//   umbel_dynamic_tree_remove(tree, door);
//   umbel_dynamic_tree_free(tree);
//
// Primitives have numbers, which are given again once they are free, the last one first. Any number
// of threads may query a tree at once; changes and umbel_dynamic_tree_free need exclusive access.
// Boxes that go in must be finite with min <= max (UMBEL_ERROR_INVALID_MESH), and a primitive's
// number must be in use (UMBEL_ERROR_INVALID_ARGUMENT). A change that is refused leaves the tree as
// it was.
#ifndef UMBEL_UMBEL_DYNAMIC_BVH_H
#define UMBEL_UMBEL_DYNAMIC_BVH_H

#include "umbel/umbel_bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct umbel_dynamic_tree umbel_dynamic_tree;

/// Builds over boxes, which become primitives 0, 1, ...; without any the tree is empty. They are
/// not needed afterwards. `config` (the defaults) and `options` may be NULL; of the config the
/// builder, its settings and the costs count. `*tree` is NULL on failure, else to be freed.
UMBEL_C_API umbel_result umbel_dynamic_tree_build(const umbel_aabb* boxes, size_t box_count,
                                                  const umbel_bvh_config* config,
                                                  const umbel_build_options* options,
                                                  umbel_dynamic_tree** tree);
/// NULL is legal.
UMBEL_C_API void umbel_dynamic_tree_free(umbel_dynamic_tree* tree);

// ---- changes -----------------------------------------------------------------------------------

/// Puts a box where it adds least to the area of the tree (Bittner et al. 2015), and exchanges
/// nodes above it where that saves area (Kensler 2008). `*primitive` is its number, UMBEL_NONE on
/// failure.
UMBEL_C_API umbel_result umbel_dynamic_tree_insert(umbel_dynamic_tree* tree, const umbel_aabb* box,
                                                   uint32_t* primitive);
UMBEL_C_API umbel_result umbel_dynamic_tree_remove(umbel_dynamic_tree* tree, uint32_t primitive);
/// Takes a primitive out and puts it where its new box belongs.
UMBEL_C_API umbel_result umbel_dynamic_tree_move(umbel_dynamic_tree* tree, uint32_t primitive,
                                                 const umbel_aabb* box);
/// Gives `count` primitives new boxes where they are, which is faster for many small steps, and
/// brings the boxes above up to date in one pass. The tree keeps its shape.
UMBEL_C_API umbel_result umbel_dynamic_tree_refit(umbel_dynamic_tree* tree,
                                                  const uint32_t* primitives,
                                                  const umbel_aabb* boxes, size_t count);
/// Builds the tree again over what there is; numbers stay. `config` and `options` as above.
UMBEL_C_API umbel_result umbel_dynamic_tree_rebuild(umbel_dynamic_tree* tree,
                                                    const umbel_bvh_config* config,
                                                    const umbel_build_options* options);

// ---- what there is -----------------------------------------------------------------------------

/// Primitives in use; 0 for NULL.
UMBEL_C_API size_t umbel_dynamic_tree_size(const umbel_dynamic_tree* tree);
/// 1 if the number is in use; else 0, as for NULL.
UMBEL_C_API int umbel_dynamic_tree_contains(const umbel_dynamic_tree* tree, uint32_t primitive);
UMBEL_C_API umbel_result umbel_dynamic_tree_get_box(const umbel_dynamic_tree* tree,
                                                    uint32_t primitive, umbel_aabb* box);
/// Of all primitives; min > max where there are none.
UMBEL_C_API umbel_result umbel_dynamic_tree_get_bounds(const umbel_dynamic_tree* tree,
                                                       umbel_aabb* bounds);

typedef struct umbel_dynamic_tree_quality {
  uint32_t struct_size;
  uint32_t rebuild_advised;  ///< 1 once sah_cost exceeds 1.5 x built_sah_cost
  double sah_cost;           ///< now, with one primitive a leaf
  double built_sah_cost;     ///< when the tree was built; 0 if that was without boxes
} umbel_dynamic_tree_quality;
UMBEL_STRUCT_INIT(umbel_dynamic_tree_quality)

/// Visits all nodes, in time linear in their number.
UMBEL_C_API umbel_result umbel_dynamic_tree_get_quality(const umbel_dynamic_tree* tree,
                                                        umbel_dynamic_tree_quality* quality);

/// The tree in arrays of the caller (umbel_bvh2_build), with leaves of up to `max_leaf_size`, [1,
/// 255], by cost: for other traversals and, over the boxes of triangles, for umbel_bvh_from_bvh2.
/// n primitives need room for 2 n - 1 nodes and n primitives.
UMBEL_C_API umbel_result umbel_dynamic_tree_snapshot(const umbel_dynamic_tree* tree,
                                                     uint32_t max_leaf_size, umbel_bvh2* snapshot);

// ---- queries -----------------------------------------------------------------------------------
//
// Functions of the caller get the caller's `user`. They may query the tree, but not change it.

/// The primitives whose boxes touch a box, sorted. *count is their number, also with `primitives`
/// NULL, or if they do not fit (UMBEL_ERROR_CAPACITY).
UMBEL_C_API umbel_result umbel_dynamic_tree_overlaps_box(const umbel_dynamic_tree* tree,
                                                         const umbel_aabb* box,
                                                         uint32_t* primitives, size_t capacity,
                                                         size_t* count);

/// Nonzero to visit what is below a box.
typedef int (*umbel_dynamic_tree_enters)(void* user, const umbel_aabb* box);
/// Nonzero to go on, 0 to end the traversal.
typedef int (*umbel_dynamic_tree_visit)(void* user, uint32_t primitive);

/// Visits every primitive below boxes that `enters` lets through, its own among them.
UMBEL_C_API umbel_result umbel_dynamic_tree_traverse(const umbel_dynamic_tree* tree,
                                                     umbel_dynamic_tree_enters enters,
                                                     umbel_dynamic_tree_visit visit, void* user);

/// A lower bound, for everything in a box, of what is searched for: a distance, or its square. NaN
/// or infinity leave the box out.
typedef double (*umbel_dynamic_tree_key)(void* user, const umbel_aabb* box);
/// The limit from then on: boxes whose key is above it are not visited, and the limit never rises.
/// -INFINITY ends the traversal.
typedef double (*umbel_dynamic_tree_search)(void* user, uint32_t primitive);

/// Visits primitives by their keys, the child with the smaller one first. `*limit` (may be NULL) is
/// the last limit, or DBL_MAX.
UMBEL_C_API umbel_result umbel_dynamic_tree_traverse_ordered(const umbel_dynamic_tree* tree,
                                                             umbel_dynamic_tree_key key,
                                                             umbel_dynamic_tree_search search,
                                                             void* user, double* limit);

/// Tests a primitive. What it returns is the limit from then on: boxes that the ray enters behind
/// it are not visited, and the limit never rises. One below the ray's t_min ends the traversal.
typedef float (*umbel_dynamic_tree_hit)(void* user, uint32_t primitive);

/// Visits the primitives whose boxes a ray meets, the nearer of two children first; each once.
/// Boxes are taken as slightly larger, so that none is missed by rounding. A ray with a NaN, a zero
/// direction or an empty interval visits nothing. `*limit` (may be NULL) is the last limit, or
/// t_max.
UMBEL_C_API umbel_result umbel_dynamic_tree_traverse_ray(const umbel_dynamic_tree* tree,
                                                         const umbel_ray* ray,
                                                         umbel_dynamic_tree_hit hit, void* user,
                                                         float* limit);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_DYNAMIC_BVH_H
