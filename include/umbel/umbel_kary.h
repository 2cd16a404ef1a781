// The tree of k-means clusters from C, with up to 64 children a node. C99.
//
//   umbel_bvh2_capacity room;
//   umbel_bvh2_capacity_init(&room);
//   umbel_bvh2_requirements(triangle_count, NULL, &room);
//   umbel_kary tree;
//   umbel_kary_init(&tree);
//   tree.nodes = malloc(room.nodes * sizeof *tree.nodes);
//   tree.node_capacity = room.nodes;
//   tree.primitives = malloc(room.primitives * sizeof *tree.primitives);
//   tree.primitive_capacity = room.primitives;
//   if (umbel_kary_build_triangles(&mesh, NULL, NULL, &tree) != UMBEL_OK) puts(umbel_last_error());
//   umbel_bvh_from_kary(&tree, &mesh, NULL, NULL, &bvh);    // to trace it
#ifndef UMBEL_UMBEL_KARY_H
#define UMBEL_UMBEL_KARY_H

#include "umbel/umbel.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A node: inner with `children` (2 to 64) from `first` on, and `count` 0; or a leaf with `count`
/// primitives from `first` on, and `children` 0. Children come after their parent; node 0 is the
/// root.
typedef struct umbel_kary_node {
  umbel_vec3 min;
  uint32_t first;
  umbel_vec3 max;
  uint16_t children;
  uint16_t count;
} umbel_kary_node;

/// A tree in arrays of the caller.
typedef struct umbel_kary {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  umbel_kary_node* nodes;
  size_t node_capacity;  ///< in: elements that `nodes` has room for
  size_t node_count;     ///< out
  uint32_t* primitives;  ///< out: in the order of the leaves
  size_t primitive_capacity;
  size_t primitive_count;
} umbel_kary;

static inline void umbel_kary_init(umbel_kary* tree) {
  memset(tree, 0, sizeof *tree);
  tree->struct_size = (uint32_t)sizeof *tree;
}

/// The clusters of k-means as they are, before they become a binary tree, by the kmeans_ settings,
/// `max_leaf_size` and `drop_invalid` of `config`. umbel_bvh2_requirements says how large the
/// arrays must be; results and failures are those of umbel_bvh2_build.
UMBEL_C_API umbel_result umbel_kary_build(const umbel_aabb* boxes, size_t box_count,
                                          const umbel_bvh_config* config,
                                          const umbel_build_options* options, umbel_kary* tree);

/// The same over triangles, as umbel_bvh_build takes them.
UMBEL_C_API umbel_result umbel_kary_build_triangles(const umbel_bvh_mesh* mesh,
                                                    const umbel_bvh_config* config,
                                                    const umbel_build_options* options,
                                                    umbel_kary* tree);

/// Measures a tree, which is checked first (UMBEL_ERROR_CORRUPT). The costs are those of `config`,
/// which may be NULL.
UMBEL_C_API umbel_result umbel_kary_get_statistics(const umbel_kary* tree,
                                                   const umbel_bvh_config* config,
                                                   umbel_bvh2_statistics* statistics);

/// A hierarchy of that tree, from this library or any other, as umbel_bvh_from_bvh2: nodes with no
/// more children than `config->width` stay as they are.
UMBEL_C_API umbel_result umbel_bvh_from_kary(const umbel_kary* tree, const umbel_bvh_mesh* mesh,
                                             const umbel_bvh_config* config,
                                             const umbel_build_options* options, umbel_bvh** bvh);

#ifdef __cplusplus
}
#endif

#endif
