// Bounding volume hierarchies from C: BVHs over triangles that answer rays, distances and overlaps,
// and the binary and k-ary trees that they are made of. C99.
//
//   umbel_bvh_mesh mesh;
//   umbel_bvh_mesh_init(&mesh);
//   mesh.positions = positions;
//   mesh.position_count = vertex_count;
//   mesh.triangles = indices;
//   mesh.triangle_count = triangle_count;
//
//   umbel_bvh* bvh;
//   if (umbel_bvh_build(&mesh, NULL, NULL, &bvh) != UMBEL_OK) puts(umbel_last_error());
//   umbel_bvh_intersect(bvh, rays, ray_count, NULL, hits);
//   umbel_bvh_free(bvh);
//
// An umbel_bvh copies all that it needs from the mesh. Any number of threads may query one at once;
// umbel_bvh_refit and umbel_bvh_free need exclusive access.
#ifndef UMBEL_UMBEL_BVH_H
#define UMBEL_UMBEL_BVH_H

#include "umbel/umbel_base.h"

#ifdef __cplusplus
extern "C" {
#endif

// ---- building ----------------------------------------------------------------------------------

/// Triangles that the caller owns.
typedef struct umbel_bvh_mesh {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  const umbel_vec3* positions;
  size_t position_count;
  const uint32_t* triangles;  ///< 3 vertex indices each
  size_t triangle_count;
  const uint32_t* masks;  ///< one a triangle, or NULL: all bits set
  /// Bytes from one position to the next; 0: one right after the other.
  size_t position_stride;
} umbel_bvh_mesh;
UMBEL_STRUCT_INIT(umbel_bvh_mesh)

typedef enum umbel_bvh_builder {
  UMBEL_BVH_SWEEP = 0,          ///< full-sweep SAH: the reference
  UMBEL_BVH_BINNED = 1,         ///< binned SAH
  UMBEL_BVH_SPATIAL = 2,        ///< SAH with spatial splits; needs triangles
  UMBEL_BVH_LBVH = 3,           ///< linear BVH
  UMBEL_BVH_HLBVH = 4,          ///< hierarchical LBVH
  UMBEL_BVH_KMEANS = 5,         ///< k-means
  UMBEL_BVH_AGGLOMERATIVE = 6,  ///< locally-ordered agglomeration with a heap
  UMBEL_BVH_AAC = 7,            ///< approximate agglomerative clustering
  UMBEL_BVH_PLOC = 8,           ///< parallel locally-ordered clustering
  UMBEL_BVH_ATRBVH = 9,         ///< treelets restructured agglomeratively
  UMBEL_BVH_INSERTION = 10      ///< incremental insertion
} umbel_bvh_builder;

/// What queries are vectorised with. Results are the same for all.
typedef enum umbel_simd {
  UMBEL_SIMD_AUTO = 0,
  UMBEL_SIMD_PORTABLE = 1,
  UMBEL_SIMD_AVX2 = 2,
  UMBEL_SIMD_AVX512 = 3
} umbel_simd;

/// How to build. umbel_bvh_config_init sets the preset "quality"; umbel_bvh_config_preset and
/// umbel_bvh_config_builder set others. Ranges in brackets.
typedef struct umbel_bvh_config {
  uint32_t struct_size;
  uint32_t builder;             ///< umbel_bvh_builder
  float traversal_cost;         ///< [> 0] of visiting an inner node, in any unit
  float intersection_cost;      ///< [> 0] of testing a triangle
  uint32_t max_leaf_size;       ///< [1, 255] most triangles a leaf
  uint32_t max_depth;           ///< [8, 255] deepest level of a leaf
  uint32_t drop_invalid;        ///< nonzero: leave out triangles with a NaN or infinite vertex
  uint32_t bins;                ///< [4, 256] binned: bins an axis
  float spatial_budget;         ///< [0, 4] spatial: references beyond the input's, as a fraction
  float spatial_overlap;        ///< [0, 1] spatial: the overlap from which on splits are tried
  uint32_t morton_bits;         ///< lbvh: 30, 60 or 63
  uint32_t hlbvh_bits;          ///< [3, 30] hlbvh: leading bits of the code built by SAH
  uint32_t ploc_radius;         ///< [1, 128] ploc: neighbours searched each way
  uint32_t treelet_size;        ///< [3, 15] atrbvh: leaves of a treelet
  uint32_t treelet_rounds;      ///< [1, 16] atrbvh
  uint32_t reinsertion_rounds;  ///< [0, 64] rounds of reinsertion after any builder
  uint32_t kmeans_clusters;     ///< [2, 1024] kmeans: k; 64 in k-ary trees
  uint32_t kmeans_candidates;   ///< [1, 64] kmeans: p
  uint32_t kmeans_iterations;   ///< [0, 100] kmeans: i
  uint32_t kmeans_manhattan;    ///< nonzero: the Manhattan distance and medians
  uint32_t aac_leaf_size;       ///< [2, 128] aac: fewer triangles are not halved any more
  float aac_epsilon;            ///< [0, 0.5] aac: n triangles forward some n^(0.5 - epsilon) nodes
  uint32_t width;               ///< children a node of a umbel_bvh: 2, 4 or 8
  uint32_t compact;             ///< nonzero: shared vertices, boxes of 16 bits; slower rays
  uint32_t simd;                ///< umbel_simd: what queries use; results are the same for all
  uint32_t kmeans_forwarded_clusters;  ///< [0, 64] kmeans: of a treelet; 1 as published
  uint32_t ploc_sweep;   ///< [0, 255] ploc: swept above so many triangles; 0 as published
  uint32_t atrbvh_bits;  ///< [0; 3, 30] atrbvh: as hlbvh_bits, to begin with; 0 as published
} umbel_bvh_config;

/// Sets the first `size` bytes of a config to the defaults; `size` is sizeof(umbel_bvh_config) as
/// the caller was compiled with it.
UMBEL_C_API void umbel_bvh_config_init_sized(umbel_bvh_config* config, size_t size);

static inline void umbel_bvh_config_init(umbel_bvh_config* config) {
  umbel_bvh_config_init_sized(config, sizeof *config);
}

/// Sets how a tree is built to a preset, "fast", "quality" or "best"; `width`, `compact` and
/// `simd` stay. Leaves the config as it is on failure.
UMBEL_C_API umbel_result umbel_bvh_config_preset(umbel_bvh_config* config, const char* name);

/// Sets how a tree is built to the defaults of a builder: "sweep", "binned", "sbvh", "lbvh",
/// "hlbvh", "kmeans", "agglomerative", "aac", "ploc", "atrbvh" or "insertion"; or to settings that
/// a paper names: "kmeans-q1" to "kmeans-q5", "aac-fast" or "aac-hq". `width`, `compact` and `simd`
/// stay. Leaves the config as it is on failure.
UMBEL_C_API umbel_result umbel_bvh_config_builder(umbel_bvh_config* config, const char* name);

/// A BVH over triangles.
typedef struct umbel_bvh umbel_bvh;

/// Builds over triangles. Degenerate and duplicate triangles are legal; indices out of range are
/// refused, and so are NaN and infinite vertices unless `drop_invalid` is set. `config` (the
/// defaults) and `options` may be NULL. `*bvh` is NULL on failure, else to be freed.
UMBEL_C_API umbel_result umbel_bvh_build(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                                         const umbel_build_options* options, umbel_bvh** bvh);

/// NULL is legal.
UMBEL_C_API void umbel_bvh_free(umbel_bvh* bvh);

// ---- queries -----------------------------------------------------------------------------------
//
// Queries take `count` rays or points and write as many results, in parallel. Rays and points with
// a NaN, rays with a zero direction or an empty interval find nothing, and no ray what lies at a t
// that is too large for a float. `options` may be NULL.

/// The points origin + t * direction for t_min <= t <= t_max.
typedef struct umbel_ray {
  umbel_vec3 origin;
  float t_min;
  umbel_vec3 direction;
  float t_max;  ///< INFINITY for no end
} umbel_ray;

/// Where a ray meets a triangle: at (1 - u - v) p0 + u p1 + v p2.
typedef struct umbel_hit {
  float t;             ///< infinite where nothing was hit
  uint32_t primitive;  ///< the triangle, or UMBEL_NONE
  float u, v;
} umbel_hit;

/// What every query of rays takes.
typedef struct umbel_ray_options {
  uint32_t struct_size;
  uint32_t mask;             ///< [all bits] sees triangles whose mask shares a bit with this
  uint32_t cull_back_faces;  ///< [0] nonzero: pass through triangles seen from behind
  uint32_t threads;          ///< [0] most threads to use; 0: all cores
} umbel_ray_options;

static inline void umbel_ray_options_init(umbel_ray_options* options) {
  memset(options, 0, sizeof *options);
  options->struct_size = (uint32_t)sizeof *options;
  options->mask = 0xffffffffu;
}

/// The nearest hit of each ray.
UMBEL_C_API umbel_result umbel_bvh_intersect(const umbel_bvh* bvh, const umbel_ray* rays,
                                             size_t count, const umbel_ray_options* options,
                                             umbel_hit* hits);

/// 1 for each ray that hits anything, else 0.
UMBEL_C_API umbel_result umbel_bvh_occluded(const umbel_bvh* bvh, const umbel_ray* rays,
                                            size_t count, const umbel_ray_options* options,
                                            uint8_t* results);

/// The nearest `hits_per_ray` hits of each ray: ray i's are the first hit_counts[i] of
/// hits[i * hits_per_ray ...], nearest first. The rest of `hits` is left as it was.
UMBEL_C_API umbel_result umbel_bvh_all_hits(const umbel_bvh* bvh, const umbel_ray* rays,
                                            size_t count, const umbel_ray_options* options,
                                            size_t hits_per_ray, umbel_hit* hits,
                                            uint32_t* hit_counts);

typedef struct umbel_closest_point {
  umbel_vec3 point;
  float distance;      ///< infinite where nothing lies within the distance asked for
  uint32_t primitive;  ///< the triangle, or UMBEL_NONE
  float u, v;          ///< as in umbel_hit
} umbel_closest_point;

/// The nearest point of the surface within `max_distance` (INFINITY: anywhere).
UMBEL_C_API umbel_result umbel_bvh_closest_point(const umbel_bvh* bvh, const umbel_vec3* points,
                                                 size_t count, float max_distance, uint32_t threads,
                                                 umbel_closest_point* results);

/// 1 for each point inside the mesh, which must be closed.
UMBEL_C_API umbel_result umbel_bvh_contains(const umbel_bvh* bvh, const umbel_vec3* points,
                                            size_t count, uint32_t threads, uint8_t* results);

/// Distance to the surface, negative inside.
UMBEL_C_API umbel_result umbel_bvh_signed_distance(const umbel_bvh* bvh, const umbel_vec3* points,
                                                   size_t count, uint32_t threads, float* results);

// Overlaps: the triangles that touch a region, sorted. Two calls: with `triangles` NULL `*count` is
// set to how many there are; with an array they are written to it, and UMBEL_ERROR_CAPACITY (with
// `*count` set, nothing written) says that it is too small.

UMBEL_C_API umbel_result umbel_bvh_overlaps_box(const umbel_bvh* bvh, const umbel_aabb* box,
                                                uint32_t* triangles, size_t capacity,
                                                size_t* count);
UMBEL_C_API umbel_result umbel_bvh_overlaps_sphere(const umbel_bvh* bvh, const umbel_sphere* sphere,
                                                   uint32_t* triangles, size_t capacity,
                                                   size_t* count);
/// `planes`: six. A few triangles near the frustum's edges may be too many.
UMBEL_C_API umbel_result umbel_bvh_overlaps_frustum(const umbel_bvh* bvh, const umbel_plane* planes,
                                                    uint32_t* triangles, size_t capacity,
                                                    size_t* count);

// ---- collision detection -----------------------------------------------------------------------

/// Triangle `first` of the first mesh and triangle `second` of the second.
typedef struct umbel_triangle_pair {
  uint32_t first, second;
} umbel_triangle_pair;

/// Every pair of triangles of two meshes that have a point in common, sorted: decided exactly;
/// triangles that only touch count. `second_to_first` places the second mesh: three rows of four of
/// an affine map, or NULL for where it was built; its corners are mapped in double and rounded to
/// floats. Two calls, as with the overlaps: with `pairs` NULL `*count` is set to how many there
/// are.
UMBEL_C_API umbel_result umbel_bvh_collide(const umbel_bvh* first, const umbel_bvh* second,
                                           const double* second_to_first, uint32_t threads,
                                           umbel_triangle_pair* pairs, size_t capacity,
                                           size_t* count);

/// Sets `*result` to 1 if there is such a pair, else to 0; stops at the first that is found.
UMBEL_C_API umbel_result umbel_bvh_collides(const umbel_bvh* first, const umbel_bvh* second,
                                            const double* second_to_first, uint32_t threads,
                                            uint8_t* result);

// ---- deforming meshes, files and statistics ----------------------------------------------------

typedef struct umbel_refit_report {
  uint32_t struct_size;
  uint32_t rebuild_advised;  ///< 1 once the cost has grown so much that a new build would pay
  double sah_cost;           ///< now, estimated by that of the wide tree
  double built_sah_cost;     ///< when the tree was built
} umbel_refit_report;
UMBEL_STRUCT_INIT(umbel_refit_report)

/// Refits to moved vertices: `mesh` has the triangles of the build and new positions. `options` and
/// `report` may be NULL.
UMBEL_C_API umbel_result umbel_bvh_refit(umbel_bvh* bvh, const umbel_bvh_mesh* mesh,
                                         const umbel_build_options* options,
                                         umbel_refit_report* report);

/// Writes a .umbvh file: beside `path` first, then renamed, so that a file is always whole.
UMBEL_C_API umbel_result umbel_bvh_save(const umbel_bvh* bvh, const char* path);

/// Reads a .umbvh file; UMBEL_ERROR_CORRUPT if it is damaged. `*bvh` is NULL on failure, else to be
/// freed.
UMBEL_C_API umbel_result umbel_bvh_load(const char* path, umbel_bvh** bvh);

typedef struct umbel_bvh_statistics {
  uint32_t struct_size;
  uint32_t width;
  uint32_t nodes;  ///< of this width
  uint32_t leaves;
  uint32_t max_depth;
  uint32_t references;      ///< triangles in leaves, repeats counted
  uint32_t triangle_count;  ///< of the mesh, dropped ones included
  uint32_t reserved;        ///< 0
  double sah_cost;          ///< of the binary tree
  uint64_t bytes;           ///< everything that a query may touch
  umbel_aabb bounds;        ///< min > max where there are no triangles
} umbel_bvh_statistics;
UMBEL_STRUCT_INIT(umbel_bvh_statistics)

UMBEL_C_API umbel_result umbel_bvh_get_statistics(const umbel_bvh* bvh,
                                                  umbel_bvh_statistics* statistics);

// ---- binary trees ------------------------------------------------------------------------------

/// A node of a binary tree: inner (count 0) with the children `first` and `first + 1`, or a leaf
/// with `count` primitives from `first` on. Children come after their parent; node 0 is the root.
typedef struct umbel_bvh2_node {
  umbel_vec3 min;
  uint32_t first;
  umbel_vec3 max;
  uint32_t count;
} umbel_bvh2_node;

/// A binary tree in arrays of the caller.
typedef struct umbel_bvh2 {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  umbel_bvh2_node* nodes;
  size_t node_capacity;  ///< in: elements that `nodes` has room for
  size_t node_count;     ///< out
  uint32_t* primitives;  ///< out: in the order of the leaves
  size_t primitive_capacity;
  size_t primitive_count;
} umbel_bvh2;
UMBEL_STRUCT_INIT(umbel_bvh2)

/// How large the arrays of umbel_bvh2 must be for any result: upper bounds.
typedef struct umbel_bvh2_capacity {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  size_t nodes;
  size_t primitives;
} umbel_bvh2_capacity;
UMBEL_STRUCT_INIT(umbel_bvh2_capacity)

/// How much room a tree over that many boxes or triangles needs. `config` may be NULL; one that
/// umbel_bvh2_build refuses is refused here too.
UMBEL_C_API umbel_result umbel_bvh2_requirements(size_t primitive_count,
                                                 const umbel_bvh_config* config,
                                                 umbel_bvh2_capacity* capacity);

/// A binary tree over boxes (finite, min <= max). On success the counts of `tree` say how much of
/// each array is filled. If an array is too small the result is UMBEL_ERROR_CAPACITY, nothing is
/// written to the arrays, and the counts say how large each must be. After any other failure the
/// counts are 0.
UMBEL_C_API umbel_result umbel_bvh2_build(const umbel_aabb* boxes, size_t box_count,
                                          const umbel_bvh_config* config,
                                          const umbel_build_options* options, umbel_bvh2* tree);

/// The same over triangles, as umbel_bvh_build takes them.
UMBEL_C_API umbel_result umbel_bvh2_build_triangles(const umbel_bvh_mesh* mesh,
                                                    const umbel_bvh_config* config,
                                                    const umbel_build_options* options,
                                                    umbel_bvh2* tree);

typedef struct umbel_bvh2_statistics {
  uint32_t struct_size;
  uint32_t nodes;
  uint32_t leaves;
  uint32_t max_depth;
  uint32_t references;
  uint32_t reserved;  ///< 0
  double sah_cost;
} umbel_bvh2_statistics;
UMBEL_STRUCT_INIT(umbel_bvh2_statistics)

/// Measures a tree, which is checked first (UMBEL_ERROR_CORRUPT). The costs are those of `config`,
/// which may be NULL.
UMBEL_C_API umbel_result umbel_bvh2_get_statistics(const umbel_bvh2* tree,
                                                   const umbel_bvh_config* config,
                                                   umbel_bvh2_statistics* statistics);

/// Makes a BVH of a binary tree over the triangles of `mesh`, from this library or any other;
/// `tree->nodes`, `node_count`, `primitives` and `primitive_count` are read, and checked
/// (UMBEL_ERROR_CORRUPT).
UMBEL_C_API umbel_result umbel_bvh_from_bvh2(const umbel_bvh2* tree, const umbel_bvh_mesh* mesh,
                                             const umbel_bvh_config* config,
                                             const umbel_build_options* options, umbel_bvh** bvh);

// ---- the k-ary tree of k-means -----------------------------------------------------------------
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
UMBEL_STRUCT_INIT(umbel_kary)

/// The clusters of k-means as they are, before they become a binary tree, by the kmeans_ settings,
/// `max_leaf_size` and `drop_invalid` of `config`. umbel_bvh2_requirements says how large the
/// arrays must be; results and failures are those of umbel_bvh2_build. So a `max_depth` that a
/// balanced binary tree would exceed is refused, though it does not limit this tree.
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

/// Makes a BVH of a k-ary tree, as umbel_bvh_from_bvh2: nodes with no more children than
/// `config->width` stay as they are.
UMBEL_C_API umbel_result umbel_bvh_from_kary(const umbel_kary* tree, const umbel_bvh_mesh* mesh,
                                             const umbel_bvh_config* config,
                                             const umbel_build_options* options, umbel_bvh** bvh);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_BVH_H
