// Umbel from C, and from every language that can call C. C99; no exception crosses this border.
//
// Clusters of a mesh, in full:
//
//   umbel_cluster_config config;
//   umbel_cluster_config_init(&config);
//   config.max_items = 64;
//
//   umbel_cluster_input input;
//   umbel_cluster_input_init(&input);
//   input.item_count = triangle_count;
//   input.item_vertices = indices;
//   input.vertices_per_item = 3;
//   input.positions = positions;
//   input.position_count = vertex_count;
//
//   umbel_cluster_capacity needed;
//   umbel_cluster_capacity_init(&needed);
//   umbel_cluster_requirements(&input, &config, &needed);
//
//   umbel_cluster_output output;
//   umbel_cluster_output_init(&output);
//   output.ranges = malloc(needed.ranges * sizeof *output.ranges);
//   output.range_capacity = needed.ranges;
//   output.items = malloc(needed.items * sizeof *output.items);
//   output.item_capacity = needed.items;
//   if (umbel_cluster_build(&input, &config, NULL, &output) != UMBEL_OK) puts(umbel_last_error());
//
// The library keeps no pointer after a call has returned, and owns no memory that it gave out.
// Every function may be called from any number of threads at once. The same input and config give
// the same bytes for any number of threads.
#ifndef UMBEL_UMBEL_H
#define UMBEL_UMBEL_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(UMBEL_SHARED) && defined(_WIN32)
#if defined(UMBEL_EXPORTS)
#define UMBEL_C_API __declspec(dllexport)
#else
#define UMBEL_C_API __declspec(dllimport)
#endif
#elif defined(__GNUC__)
#define UMBEL_C_API __attribute__((visibility("default")))
#else
#define UMBEL_C_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

// ---- results -----------------------------------------------------------------------------------

typedef enum umbel_result {
  UMBEL_OK = 0,
  UMBEL_ERROR_INVALID_ARGUMENT = 1,  ///< a config value, a size or a combination that cannot be met
  UMBEL_ERROR_INVALID_MESH = 2,      ///< NaN, infinity or an index out of range in the geometry
  UMBEL_ERROR_IO = 3,                ///< a file cannot be opened, read or written
  UMBEL_ERROR_CORRUPT = 4,           ///< a file's bytes are not what its format says
  UMBEL_ERROR_UNSUPPORTED = 5,       ///< valid, but more than this version of the library can do
  UMBEL_ERROR_CANCELLED = 6,         ///< the progress callback asked to stop
  UMBEL_ERROR_CAPACITY = 7,          ///< an output array is too small; its count says what it needs
  UMBEL_ERROR_OUT_OF_MEMORY = 8,
  UMBEL_ERROR_INTERNAL = 9,  ///< a fault of the library itself
  UMBEL_ERROR_DEVICE = 10    ///< a call of CUDA failed; the sentence ends with CUDA's own words
} umbel_result;

/// One sentence about this thread's last call that failed, naming the argument, the index and the
/// value; "" before the first. Valid until the thread's next failure; never NULL.
UMBEL_C_API const char* umbel_last_error(void);

/// The name of a result, as "invalid argument"; "unknown result" for any other number.
UMBEL_C_API const char* umbel_result_name(umbel_result result);

/// The library's version, as "0.1.0".
UMBEL_C_API const char* umbel_version(void);

// ---- structs -----------------------------------------------------------------------------------
//
// Each struct below that starts with `struct_size` must go through its init function before
// anything else. That field tells the library which version of the struct it was given, so that a
// program works with a newer library (fields it does not know keep their defaults), and with an
// older one as long as what that does not know is zero (UMBEL_ERROR_UNSUPPORTED otherwise).
// Other languages set `struct_size` to the struct's size and all else to zero, and call
// the _init_sized function of configs (umbel_ray_options.mask: all ones), whose defaults are not.

typedef struct umbel_vec3 {
  float x, y, z;
} umbel_vec3;

/// A point of the world, where floats would not do.
typedef struct umbel_vec3d {
  double x, y, z;
} umbel_vec3d;

/// A point of the world as one relative to `origin` (umbel_asset_info.origin), as views, rays and
/// positions are: subtracted first, rounded to floats then.
static inline umbel_vec3 umbel_relative_to(umbel_vec3d origin, umbel_vec3d point) {
  umbel_vec3 local;
  local.x = (float)(point.x - origin.x);
  local.y = (float)(point.y - origin.y);
  local.z = (float)(point.z - origin.z);
  return local;
}

typedef struct umbel_aabb {
  umbel_vec3 min, max;
} umbel_aabb;

/// The half-open index range [offset, offset + count).
typedef struct umbel_range {
  uint32_t offset, count;
} umbel_range;

/// Called from the thread that called the build, with the fraction done in [0, 1] (it never falls)
/// and the name of the stage. Return nonzero to go on, 0 to cancel.
typedef int (*umbel_progress)(float fraction, const char* stage, void* user);

/// What every build takes. None of it changes the result.
typedef struct umbel_build_options {
  uint32_t struct_size;
  uint32_t threads;         ///< most threads to use; 0: all cores
  umbel_progress progress;  ///< NULL: none
  void* progress_user;      ///< handed to `progress`
} umbel_build_options;

/// What to cluster: items with boxes, or triangles with positions.
typedef struct umbel_cluster_input {
  uint32_t struct_size;
  /// Vertices of each item in `item_vertices`: 3 for triangles, 4 for quads, any number.
  uint32_t vertices_per_item;
  size_t item_count;
  /// One an item, finite, min <= max. NULL if `positions` are given instead.
  const umbel_aabb* boxes;
  /// One an item, or NULL: the boxes' centres.
  const umbel_vec3* centroids;
  /// `item_count * vertices_per_item` vertex indices, or NULL. Needed for
  /// umbel_cluster_config.max_vertices (or the connections' vertex bits are), for
  /// `shared_vertex_weight` and with `positions`.
  const uint32_t* item_vertices;
  /// Vertex positions, from which the boxes are made; `vertices_per_item` must be 3. NULL if
  /// `boxes` are given.
  const umbel_vec3* positions;
  size_t position_count;
  /// Weighted adjacency: item i is connected to connection_targets[offset .. offset + count) of
  /// connection_ranges[i]. Should be symmetric. All NULL: no connections.
  const umbel_range* connection_ranges;  ///< one an item
  const uint32_t* connection_targets;    ///< `connection_count` item indices
  const float* connection_weights;       ///< `connection_count`, >= 0, or NULL: all 1
  /// `connection_count`, or NULL. Bit k is set where vertex k of the item is one of the target's as
  /// well. With `vertices_per_item` from 1 to 8 they stand for `item_vertices` where vertices have
  /// no indices: umbel_cluster_config.max_vertices then counts by them. All pairs of items that
  /// share a vertex must be connected, in both directions.
  const uint8_t* connection_vertex_bits;
  size_t connection_count;
  /// Item ranges that are clustered each by itself. They must not overlap, may be empty and in any
  /// order; items in none stay where they are. None (0): one segment of all items.
  const umbel_range* segments;
  size_t segment_count;
  /// Weight of one shared vertex as a connection between two items; 0: none.
  float shared_vertex_weight;
  uint32_t reserved;  ///< 0
} umbel_cluster_input;

/// How to cluster. The defaults in brackets are those of umbel_cluster_config_init.
typedef struct umbel_cluster_config {
  uint32_t struct_size;
  uint32_t min_items;           ///< [64] >= 1, <= max_items
  uint32_t max_items;           ///< [128] >= 1
  uint32_t max_vertices;        ///< [0] most unique vertices a cluster; 0: no limit
  float underfill_cost;         ///< [0.5] in [0, 1]: price of items missing to full clusters
  float overlap_cost;           ///< [0] in [0, 1]: price of overlap between two sides of a split
  float vertex_underfill_cost;  ///< [0.5] in [0, 1]: price of vertices missing to full clusters
  /// [0] Nodes with more items than this are split at the median without a search; 0: never.
  uint32_t presplit_threshold;
  /// [0] Nonzero: try some positions an axis instead of all. Faster, slightly larger boxes.
  uint32_t coarse;
} umbel_cluster_config;

/// How large the arrays of umbel_cluster_output must be for any result: upper bounds.
typedef struct umbel_cluster_capacity {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  size_t ranges;      ///< most clusters
  size_t items;       ///< exact: the number of items
  size_t segments;    ///< exact: the number of segments
} umbel_cluster_capacity;

/// Arrays of the caller, and how much of them was filled.
typedef struct umbel_cluster_output {
  uint32_t struct_size;
  uint32_t reserved;      ///< 0
  umbel_range* ranges;    ///< out: of `items`, one a cluster
  size_t range_capacity;  ///< in: elements that `ranges` has room for
  size_t range_count;     ///< out
  uint32_t* items;        ///< out: a permutation of all item indices, in cluster order
  size_t item_capacity;
  size_t item_count;
  umbel_range* segments;  ///< out: of `ranges`, one a segment; NULL: not wanted
  size_t segment_capacity;
  size_t segment_count;
} umbel_cluster_output;

/// How good clusters are.
typedef struct umbel_cluster_quality {
  uint32_t struct_size;
  uint32_t min_size, max_size;  ///< items of the smallest and of the largest cluster
  uint32_t max_vertices;        ///< unique vertices of the cluster that has most
  size_t clusters;
  double mean_fill;           ///< items / (clusters * max_items)
  double mean_vertices;       ///< unique vertices a cluster (0 where items have none)
  double surface_area_ratio;  ///< sum of cluster box areas / area of the box of all
  double sah;                 ///< the same, each weighted by its items
  double overlap;             ///< mean number of cluster boxes that a random line pierces
  double ratio_cut;           ///< sum over clusters of cut connection weight / items
} umbel_cluster_quality;

/// Arrays of the caller for umbel_cluster_order, and how much of them was filled.
typedef struct umbel_cluster_meshlets {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  /// out: the clusters' items with the triangles of each cluster in their new order; the clusters'
  /// ranges hold as they are.
  uint32_t* items;
  size_t item_capacity;  ///< in: as many as the clusters have items are needed
  size_t item_count;     ///< out
  /// out: cluster c has vertices[vertex_offsets[c]] up to vertices[vertex_offsets[c + 1]].
  uint32_t* vertex_offsets;
  size_t vertex_offset_capacity;  ///< in: one more than clusters are needed
  size_t vertex_offset_count;     ///< out
  uint32_t* vertices;             ///< out: mesh vertices, in the order in which triangles use them
  size_t vertex_capacity;         ///< in: three an item are always enough
  size_t vertex_count;            ///< out
  /// out: the three corners of each item, as indices into its cluster's vertices; zero where an
  /// item is in no cluster.
  uint8_t* corners;
  size_t corner_capacity;  ///< in: three an item are needed
  size_t corner_count;     ///< out
} umbel_cluster_meshlets;

/// What a cluster can be culled by. With e the eye: the cluster is outside a frustum that misses
/// the sphere, and faces away as a whole where
///   dot(normalize(cone_apex - e), cone_axis) >= cone_cutoff   or, without the apex,
///   dot(center - e, cone_axis) >= cone_cutoff * length(center - e) + radius.
typedef struct umbel_cull_bounds {
  umbel_vec3 center;  ///< of a sphere that contains all the cluster's triangles
  float radius;
  umbel_vec3 cone_apex;  ///< behind every triangle
  umbel_vec3 cone_axis;  ///< unit length: where the triangles face; zero if there is no such cone
  float cone_cutoff;     ///< sine of the cone's half angle, and a little; 1 if there is no cone
} umbel_cull_bounds;

static inline void umbel_cluster_meshlets_init(umbel_cluster_meshlets* meshlets) {
  memset(meshlets, 0, sizeof *meshlets);
  meshlets->struct_size = (uint32_t)sizeof *meshlets;
}

static inline void umbel_build_options_init(umbel_build_options* options) {
  memset(options, 0, sizeof *options);
  options->struct_size = (uint32_t)sizeof *options;
}

static inline void umbel_cluster_input_init(umbel_cluster_input* input) {
  memset(input, 0, sizeof *input);
  input->struct_size = (uint32_t)sizeof *input;
}

static inline void umbel_cluster_capacity_init(umbel_cluster_capacity* capacity) {
  memset(capacity, 0, sizeof *capacity);
  capacity->struct_size = (uint32_t)sizeof *capacity;
}

static inline void umbel_cluster_output_init(umbel_cluster_output* output) {
  memset(output, 0, sizeof *output);
  output->struct_size = (uint32_t)sizeof *output;
}

static inline void umbel_cluster_quality_init(umbel_cluster_quality* quality) {
  memset(quality, 0, sizeof *quality);
  quality->struct_size = (uint32_t)sizeof *quality;
}

/// Sets the first `size` bytes of a config to the defaults; `size` is sizeof(umbel_cluster_config)
/// as the caller was compiled with it.
UMBEL_C_API void umbel_cluster_config_init_sized(umbel_cluster_config* config, size_t size);

static inline void umbel_cluster_config_init(umbel_cluster_config* config) {
  umbel_cluster_config_init_sized(config, sizeof *config);
}

// ---- clusters ----------------------------------------------------------------------------------

/// Sets an initialised config to one of the presets: "quality" (lowest area), "fast", or "exact"
/// (all clusters of a segment have `max_items` items but one). Leaves it as it is on failure.
UMBEL_C_API umbel_result umbel_cluster_config_preset(umbel_cluster_config* config, const char* name,
                                                     uint32_t max_items);

/// How much room umbel_cluster_build needs. Looks at counts, segments and the config only, not at
/// boxes, vertices or connections.
///
/// Without a vertex limit a segment of n items has at most ceil(n / min_items) clusters; with one
/// it may have n, so a caller who is short of memory can give less room for ranges, and try again
/// with `range_count` when the answer is UMBEL_ERROR_CAPACITY. `config` may be NULL: the defaults.
UMBEL_C_API umbel_result umbel_cluster_requirements(const umbel_cluster_input* input,
                                                    const umbel_cluster_config* config,
                                                    umbel_cluster_capacity* capacity);

/// Clusters the items by recursive axis-aligned bisection. Every item of a segment is in exactly
/// one cluster of that segment; cluster sizes are within [min_items, max_items] with at most one
/// smaller cluster a segment, except that a vertex limit may make more.
///
/// `config` may be NULL (the defaults), and so may `options`.
///
/// On success the three counts of `output` say how much of each array is filled. If an array is
/// too small the result is UMBEL_ERROR_CAPACITY, nothing is written to any array, and the counts
/// say how large each must be; where `items` or `segments` is too small that is known before any
/// work is done, and `range_count` is then the upper bound. After any other failure the counts are
/// 0 and the arrays as they were.
UMBEL_C_API umbel_result umbel_cluster_build(const umbel_cluster_input* input,
                                             const umbel_cluster_config* config,
                                             const umbel_build_options* options,
                                             umbel_cluster_output* output);

/// Measures clusters, of this library or any other: `clusters->ranges`, `range_count`, `items` and
/// `item_count` are read. `max_items` is what a full cluster has.
UMBEL_C_API umbel_result umbel_cluster_metrics(const umbel_cluster_input* input,
                                               const umbel_cluster_output* clusters,
                                               uint32_t max_items, umbel_cluster_quality* quality);

/// Orders the triangles and vertices of each cluster for vertex reuse and rasterisation, as mesh
/// shaders take them: at most 256 vertices and 512 triangles a cluster. `input` must be triangles
/// with positions; `clusters->ranges`, `range_count`, `items` and `item_count` are read. At `level`
/// 0 triangles keep their corner order; levels 1 to 9 try harder to make what is stored compress
/// well (3 is a good value), and may rotate corners. Arrays and counts of `meshlets` are filled as
/// those of umbel_cluster_build are; where an array is too small, nothing is written to any.
UMBEL_C_API umbel_result umbel_cluster_order(const umbel_cluster_input* input,
                                             const umbel_cluster_output* clusters, int level,
                                             const umbel_build_options* options,
                                             umbel_cluster_meshlets* meshlets);

/// Bounding sphere and normal cone of each cluster, for culling: bounds[0 .. range_count), of which
/// `capacity` must be at least as many. `input` and `clusters` as for umbel_cluster_order.
UMBEL_C_API umbel_result umbel_cluster_cull_bounds(const umbel_cluster_input* input,
                                                   const umbel_cluster_output* clusters,
                                                   const umbel_build_options* options,
                                                   umbel_cull_bounds* bounds, size_t capacity);

// ---- bounding volume hierarchies ---------------------------------------------------------------
//
// Rays against a mesh, in full:
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
// A umbel_bvh holds all that it needs; the mesh may go. Any number of threads may ask one at the
// same time; only umbel_bvh_refit and umbel_bvh_free need it for themselves.

/// "No such triangle", where nothing was hit or found.
#define UMBEL_NONE 0xffffffffu

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

typedef enum umbel_simd {
  UMBEL_SIMD_AUTO = 0,
  UMBEL_SIMD_PORTABLE = 1,
  UMBEL_SIMD_AVX2 = 2,
  UMBEL_SIMD_AVX512 = 3
} umbel_simd;

/// How to build. umbel_bvh_config_init sets the preset "quality"; umbel_bvh_config_preset and
/// umbel_bvh_config_builder set others. Ranges in brackets.
/// Where the time of a build by k-means goes: seconds by the wall clock.
typedef struct umbel_kmeans_times {
  double boxes;          ///< the scene's box, and the triangles' in the builder's own arrays
  double seeding;        ///< choosing representatives
  double iterations;     ///< assigning triangles and moving representatives
  double sizes;          ///< of the new clusters, and where each goes
  double reordering;     ///< moving triangles to their clusters
  double agglomeration;  ///< binary trees, with the boxes of their nodes
} umbel_kmeans_times;

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
  uint32_t morton_bits;         ///< lbvh: 30 or 63
  uint32_t hlbvh_bits;          ///< [3, 30] hlbvh: leading bits of the code built by SAH
  uint32_t ploc_radius;         ///< [1, 128] ploc: neighbours searched each way
  uint32_t treelet_size;        ///< [3, 15] atrbvh: leaves of a treelet
  uint32_t treelet_rounds;      ///< [1, 16] atrbvh
  uint32_t reinsertion_rounds;  ///< [0, 64] rounds of reinsertion after any builder
  uint32_t kmeans_clusters;     ///< [2, 64] kmeans: k
  uint32_t kmeans_candidates;   ///< [1, 64] kmeans: p
  uint32_t kmeans_iterations;   ///< [0, 100] kmeans: i
  uint32_t kmeans_manhattan;    ///< nonzero: the Manhattan distance and medians
  uint32_t aac_leaf_size;       ///< [2, 128] aac: fewer triangles are not halved any more
  float aac_epsilon;            ///< [0, 0.5] aac: n triangles hand up some n^(0.5 - epsilon) nodes
  uint32_t width;               ///< children a node of a umbel_bvh: 2, 4 or 8
  uint32_t compact;             ///< nonzero: shared vertices, boxes of 16 bits; slower rays
  uint32_t simd;                ///< umbel_simd: what queries use; results are the same for all
  uint32_t kmeans_handed_up;    ///< [0, 64] kmeans: nodes that a treelet hands up; 1 as published
  uint32_t ploc_sweep;          ///< [0, 255] ploc: swept above so many triangles; 0 as published
  uint32_t atrbvh_bits;         ///< [0; 3, 30] atrbvh: as hlbvh_bits, to begin with; 0 as published
  umbel_kmeans_times* kmeans_times;  ///< kmeans: where a build writes its times, or NULL
} umbel_bvh_config;

/// Triangles that the caller owns.
typedef struct umbel_bvh_mesh {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  const umbel_vec3* positions;
  size_t position_count;
  const uint32_t* triangles;  ///< 3 vertex indices each
  size_t triangle_count;
  const uint32_t* masks;  ///< one a triangle, or NULL: all bits set
} umbel_bvh_mesh;

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

typedef struct umbel_closest_point {
  umbel_vec3 point;
  float distance;      ///< infinite where nothing lies within the distance asked for
  uint32_t primitive;  ///< the triangle, or UMBEL_NONE
  float u, v;          ///< as in umbel_hit
} umbel_closest_point;

typedef struct umbel_sphere {
  umbel_vec3 center;
  float radius;
} umbel_sphere;

/// The points with dot(normal, p) + offset >= 0.
typedef struct umbel_plane {
  umbel_vec3 normal;
  float offset;
} umbel_plane;

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

typedef struct umbel_refit_report {
  uint32_t struct_size;
  uint32_t rebuild_advised;  ///< 1 once the cost has grown so much that a new build would pay
  double sah_cost;           ///< now
  double built_sah_cost;     ///< when the tree was built
} umbel_refit_report;

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

/// How large the arrays of umbel_bvh2 must be for any result: upper bounds.
typedef struct umbel_bvh2_capacity {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  size_t nodes;
  size_t primitives;
} umbel_bvh2_capacity;

typedef struct umbel_bvh2_statistics {
  uint32_t struct_size;
  uint32_t nodes;
  uint32_t leaves;
  uint32_t max_depth;
  uint32_t references;
  uint32_t reserved;  ///< 0
  double sah_cost;
} umbel_bvh2_statistics;

/// A hierarchy over triangles.
typedef struct umbel_bvh umbel_bvh;

/// As umbel_cluster_config_init_sized.
UMBEL_C_API void umbel_bvh_config_init_sized(umbel_bvh_config* config, size_t size);

static inline void umbel_bvh_config_init(umbel_bvh_config* config) {
  umbel_bvh_config_init_sized(config, sizeof *config);
}

static inline void umbel_bvh_mesh_init(umbel_bvh_mesh* mesh) {
  memset(mesh, 0, sizeof *mesh);
  mesh->struct_size = (uint32_t)sizeof *mesh;
}

static inline void umbel_ray_options_init(umbel_ray_options* options) {
  memset(options, 0, sizeof *options);
  options->struct_size = (uint32_t)sizeof *options;
  options->mask = 0xffffffffu;
}

static inline void umbel_bvh_statistics_init(umbel_bvh_statistics* statistics) {
  memset(statistics, 0, sizeof *statistics);
  statistics->struct_size = (uint32_t)sizeof *statistics;
}

static inline void umbel_refit_report_init(umbel_refit_report* report) {
  memset(report, 0, sizeof *report);
  report->struct_size = (uint32_t)sizeof *report;
}

static inline void umbel_bvh2_init(umbel_bvh2* tree) {
  memset(tree, 0, sizeof *tree);
  tree->struct_size = (uint32_t)sizeof *tree;
}

static inline void umbel_bvh2_capacity_init(umbel_bvh2_capacity* capacity) {
  memset(capacity, 0, sizeof *capacity);
  capacity->struct_size = (uint32_t)sizeof *capacity;
}

static inline void umbel_bvh2_statistics_init(umbel_bvh2_statistics* statistics) {
  memset(statistics, 0, sizeof *statistics);
  statistics->struct_size = (uint32_t)sizeof *statistics;
}

/// Sets how a tree is built to a preset, "fast", "quality" or "best"; `width`, `compact` and
/// `simd` stay. Leaves the config as it is on failure.
UMBEL_C_API umbel_result umbel_bvh_config_preset(umbel_bvh_config* config, const char* name);

/// Sets how a tree is built to the defaults of a builder: "sweep", "binned", "sbvh", "lbvh",
/// "hlbvh", "kmeans", "agglomerative", "aac", "ploc", "atrbvh" or "insertion"; or to settings that
/// a paper names: "kmeans-q1" to "kmeans-q5", "aac-fast" or "aac-hq". `width`, `compact` and `simd`
/// stay. Leaves the config as it is on failure.
UMBEL_C_API umbel_result umbel_bvh_config_builder(umbel_bvh_config* config, const char* name);

/// Builds over triangles. Degenerate and duplicate triangles are legal; indices out of range are
/// refused, and so are NaN and infinite vertices unless `drop_invalid` is set. `config` (the
/// defaults) and `options` may be NULL. `*bvh` is NULL on failure, else to be freed.
UMBEL_C_API umbel_result umbel_bvh_build(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                                         const umbel_build_options* options, umbel_bvh** bvh);

/// Makes a hierarchy of a binary tree over the triangles of `mesh`, from this library or any other;
/// `tree->nodes`, `node_count`, `primitives` and `primitive_count` are read, and checked
/// (UMBEL_ERROR_CORRUPT).
UMBEL_C_API umbel_result umbel_bvh_from_bvh2(const umbel_bvh2* tree, const umbel_bvh_mesh* mesh,
                                             const umbel_bvh_config* config,
                                             const umbel_build_options* options, umbel_bvh** bvh);

/// NULL is legal.
UMBEL_C_API void umbel_bvh_free(umbel_bvh* bvh);

// Queries take `count` rays or points and write as many results, in parallel. Rays and points with
// a NaN, rays with a zero direction or an empty interval find nothing. `options` may be NULL.

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

/// Follows moved vertices: `mesh` has the triangles of the build and new positions. `options` and
/// `report` may be NULL.
UMBEL_C_API umbel_result umbel_bvh_refit(umbel_bvh* bvh, const umbel_bvh_mesh* mesh,
                                         const umbel_build_options* options,
                                         umbel_refit_report* report);

/// Writes a .umbvh file, beside its name first, so that no half file is left.
UMBEL_C_API umbel_result umbel_bvh_save(const umbel_bvh* bvh, const char* path);

/// Reads one; what is not whole is refused (UMBEL_ERROR_CORRUPT). `*bvh` is NULL on failure.
UMBEL_C_API umbel_result umbel_bvh_load(const char* path, umbel_bvh** bvh);

UMBEL_C_API umbel_result umbel_bvh_get_statistics(const umbel_bvh* bvh,
                                                  umbel_bvh_statistics* statistics);

/// How much room a tree over that many boxes or triangles needs. `config` may be NULL.
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

/// Measures a tree, which is checked first (UMBEL_ERROR_CORRUPT). The costs are those of `config`,
/// which may be NULL.
UMBEL_C_API umbel_result umbel_bvh2_get_statistics(const umbel_bvh2* tree,
                                                   const umbel_bvh_config* config,
                                                   umbel_bvh2_statistics* statistics);

// ---- assets and residency ----------------------------------------------------------------------
//
//   umbel_asset* asset;
//   if (umbel_asset_open("dragon.umbel", &asset) != UMBEL_OK) puts(umbel_last_error());
//   umbel_residency* residency;
//   umbel_residency_create(asset, 64 << 20, 2, &residency);
//   umbel_stream_view view = {0};                    // the first mesh
//   view.eye = umbel_relative_to(info.origin, eye);  // in its space
//   view.threshold = 2 * tan(fov_y / 2) / height;    // errors of a pixel
//   umbel_residency_step(residency, &view, 1, seconds, &step);     // each frame
//   umbel_residency_cut(residency, clusters, capacity, &count);    // what to draw
//   umbel_residency_cluster(residency, &clusters[i], &geometry);
//   umbel_residency_free(residency);
//   umbel_asset_free(asset);

/// An open .umbel file, for any number of threads at the same time.
typedef struct umbel_asset umbel_asset;
/// Pages of an asset in memory; one thread at a time. The asset must outlive it.
typedef struct umbel_residency umbel_residency;

/// Fills `out` with `size` bytes from `offset` on; 0 if it did. Called from many threads at once.
typedef int (*umbel_read)(void* user, uint64_t offset, uint64_t size, void* out);

typedef struct umbel_asset_info {
  uint32_t struct_size;
  uint32_t version_major, version_minor;
  uint32_t pages, meshes, instances;
  uint32_t max_triangles, max_vertices;  ///< limits that every cluster keeps
  uint64_t file_bytes, head_bytes;       ///< opening reads the latter
  uint64_t checksum;                     ///< of the whole file
  uint64_t source_triangles;             ///< of all meshes
  umbel_aabb bounds;                     ///< relative to origin; min > max where there is nothing
  umbel_vec3d origin;                    ///< points of the asset are at origin + point
} umbel_asset_info;

/// One mesh as somebody sees it, in its own space, relative to the asset's origin: errors up to
/// `threshold` times the distance from `eye`, plus `error`, are small enough. One of the two must
/// be 0.
typedef struct umbel_stream_view {
  uint32_t mesh;
  umbel_vec3 eye;
  float threshold;
  float error;
} umbel_stream_view;

typedef struct umbel_stream_step {
  uint32_t struct_size;
  float worst_error;  ///< times what was asked for; at most 1 where nothing is missing
  uint32_t open_groups, missing_groups, loaded, evicted, requested, cancelled;
  uint64_t resident_bytes;
  uint64_t failures;   ///< of loads, since the beginning
  uint32_t looked_at;  ///< groups whose errors may have become too large, or small enough
  uint32_t caught_up;  ///< 0: there was more to look at than a step does; the next goes on
} umbel_stream_step;

/// A cluster of a cut: of which view, and where it is.
typedef struct umbel_stream_cluster {
  uint32_t view, page, group, cluster;
} umbel_stream_cluster;

/// Arrays of at least 256 vertices and 256 triangles, or NULL for what is not wanted.
typedef struct umbel_cluster_geometry {
  uint32_t struct_size;
  uint32_t vertex_count, triangle_count, material;
  umbel_vec3* positions;
  umbel_vec3* normals;  ///< left alone where the asset has none
  uint8_t* triangles;   ///< three a triangle
} umbel_cluster_geometry;

static inline void umbel_asset_info_init(umbel_asset_info* info) {
  memset(info, 0, sizeof *info);
  info->struct_size = (uint32_t)sizeof *info;
}

static inline void umbel_stream_step_init(umbel_stream_step* step) {
  memset(step, 0, sizeof *step);
  step->struct_size = (uint32_t)sizeof *step;
}

static inline void umbel_cluster_geometry_init(umbel_cluster_geometry* geometry) {
  memset(geometry, 0, sizeof *geometry);
  geometry->struct_size = (uint32_t)sizeof *geometry;
}

/// *asset is NULL after a failure. `path` is UTF-8.
UMBEL_C_API umbel_result umbel_asset_open(const char* path, umbel_asset** asset);
/// From a source of `size` bytes that `read` reads; `user` is handed through to it, until the asset
/// is freed.
UMBEL_C_API umbel_result umbel_asset_open_source(uint64_t size, umbel_read read, void* user,
                                                 umbel_asset** asset);
UMBEL_C_API void umbel_asset_free(umbel_asset* asset);
UMBEL_C_API umbel_result umbel_asset_get_info(const umbel_asset* asset, umbel_asset_info* info);

/// With at most `budget_bytes` of pages, loaded by so many threads. Reads the pages of all roots.
UMBEL_C_API umbel_result umbel_residency_create(const umbel_asset* asset, uint64_t budget_bytes,
                                                uint32_t threads, umbel_residency** residency);
/// Waits for loads that are under way.
UMBEL_C_API void umbel_residency_free(umbel_residency* residency);
/// Chooses what the views show, and asks for what is missing. `seconds` are of any clock that does
/// not run backwards.
UMBEL_C_API umbel_result umbel_residency_step(umbel_residency* residency,
                                              const umbel_stream_view* views, size_t view_count,
                                              double seconds, umbel_stream_step* step);
/// What the views of the last step show. *count is how many there are, also if they do not fit
/// (UMBEL_ERROR_CAPACITY).
UMBEL_C_API umbel_result umbel_residency_cut(const umbel_residency* residency,
                                             umbel_stream_cluster* clusters, size_t capacity,
                                             size_t* count);
/// Decodes a cluster of the last cut.
UMBEL_C_API umbel_result umbel_residency_cluster(const umbel_residency* residency,
                                                 const umbel_stream_cluster* cluster,
                                                 umbel_cluster_geometry* geometry);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_H
