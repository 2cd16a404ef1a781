// Clusters of triangles, or of any items that have boxes, from C. C99.
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
#ifndef UMBEL_UMBEL_CLUSTER_H
#define UMBEL_UMBEL_CLUSTER_H

#include "umbel/umbel_base.h"

#ifdef __cplusplus
extern "C" {
#endif

// ---- building ----------------------------------------------------------------------------------

/// What to cluster: items with boxes, or triangles with positions. Arrays stay the caller's.
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
  /// Bytes from one position to the next, a multiple of nothing; 0: one right after the other.
  size_t position_stride;
  /// Weighted adjacency: item i is connected to connection_targets[offset .. offset + count) of
  /// connection_ranges[i]. Should be symmetric. All NULL: no connections.
  const umbel_range* connection_ranges;  ///< one an item
  const uint32_t* connection_targets;    ///< `connection_count` item indices
  /// `connection_count`, >= 0. NULL: all 1, or all 0 beside connection_vertex_bits, which then only
  /// count vertices.
  const float* connection_weights;
  /// `connection_count`, or NULL. Bit k is set where vertex k of the item is one of the target's as
  /// well. With `vertices_per_item` from 1 to 8 they stand for `item_vertices` where vertices have
  /// no indices: umbel_cluster_config.max_vertices then counts by them. All pairs of items that
  /// share a vertex must be connected, in both directions.
  const uint8_t* connection_vertex_bits;
  size_t connection_count;
  /// Item ranges that are clustered each by itself. They must not overlap, may be empty and in any
  /// order; items in none stay where they are. NULL: one segment of all items. (Not NULL and
  /// segment_count 0: there is no segment, and so no cluster.)
  const umbel_range* segments;
  size_t segment_count;
  /// Weight of one shared vertex as a connection between two items; 0: none.
  float shared_vertex_weight;
  uint32_t reserved;  ///< 0
} umbel_cluster_input;
UMBEL_STRUCT_INIT(umbel_cluster_input)

/// How to cluster. The defaults in brackets are those of umbel_cluster_config_init.
typedef struct umbel_cluster_config {
  uint32_t struct_size;
  uint32_t min_items;           ///< [64] >= 1, <= max_items
  uint32_t max_items;           ///< [128] >= 1
  uint32_t max_vertices;        ///< [UMBEL_NO_LIMIT] most unique vertices a cluster
  float underfill_cost;         ///< [0.5] in [0, 1]: penalty for clusters with too few items
  float overlap_cost;           ///< [0] in [0, 1]: penalty for overlap of the two sides of a split
  float vertex_underfill_cost;  ///< [0.5] in [0, 1]: penalty for clusters with too few vertices
  /// [0] Nodes with more items than this are split at the median without a search; 0: never.
  uint32_t presplit_threshold;
  /// [0] Nonzero: try some positions an axis instead of all. Faster, slightly larger boxes.
  uint32_t coarse;
} umbel_cluster_config;

/// Sets the first `size` bytes of a config to the defaults; `size` is sizeof(umbel_cluster_config)
/// as the caller was compiled with it.
UMBEL_C_API void umbel_cluster_config_init_sized(umbel_cluster_config* config, size_t size);

static inline void umbel_cluster_config_init(umbel_cluster_config* config) {
  umbel_cluster_config_init_sized(config, sizeof *config);
}

/// Sets an initialised config to one of the presets: "quality" (lowest area), "fast", or "exact"
/// (all clusters of a segment have `max_items` items but one). Leaves it as it is on failure.
UMBEL_C_API umbel_result umbel_cluster_config_preset(umbel_cluster_config* config, const char* name,
                                                     uint32_t max_items);

/// How large the arrays of umbel_cluster_output must be for any result: upper bounds.
typedef struct umbel_cluster_capacity {
  uint32_t struct_size;
  uint32_t reserved;  ///< 0
  size_t ranges;      ///< most clusters
  size_t items;       ///< exact: the number of items
  size_t segments;    ///< exact: the number of segments
} umbel_cluster_capacity;
UMBEL_STRUCT_INIT(umbel_cluster_capacity)

/// How much room umbel_cluster_build needs. Reads counts, segments and the config only; boxes,
/// vertices and connections may still be NULL.
///
/// Without a vertex limit a segment of n items has at most ceil(n / min_items) clusters; with one
/// it may have n, so a caller who is short of memory can give less room for ranges, and try again
/// with `range_count` when the answer is UMBEL_ERROR_CAPACITY. `config` may be NULL: the defaults.
UMBEL_C_API umbel_result umbel_cluster_requirements(const umbel_cluster_input* input,
                                                    const umbel_cluster_config* config,
                                                    umbel_cluster_capacity* capacity);

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
UMBEL_STRUCT_INIT(umbel_cluster_output)

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

// ---- what to do with clusters ------------------------------------------------------------------

/// How good clusters are.
typedef struct umbel_cluster_metrics {
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
} umbel_cluster_metrics;
UMBEL_STRUCT_INIT(umbel_cluster_metrics)

/// Measures clusters, of this library or any other: `clusters->ranges`, `range_count`, `items` and
/// `item_count` are read. `max_items` is what a full cluster has.
UMBEL_C_API umbel_result umbel_cluster_get_metrics(const umbel_cluster_input* input,
                                                   const umbel_cluster_output* clusters,
                                                   uint32_t max_items,
                                                   umbel_cluster_metrics* metrics);

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
UMBEL_STRUCT_INIT(umbel_cluster_meshlets)

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

/// Bounds for culling a cluster. With e the eye: the cluster is outside a frustum that misses the
/// sphere, and no triangle's front is visible where
///   dot(normalize(cone_apex - e), cone_axis) >= cone_cutoff   or, without the apex,
///   dot(center - e, cone_axis) >= cone_cutoff * length(center - e) + radius.
typedef struct umbel_cluster_bounds {
  umbel_vec3 center;  ///< of a sphere that contains all the cluster's triangles
  float radius;
  umbel_vec3 cone_apex;  ///< behind every triangle
  umbel_vec3 cone_axis;  ///< unit length: where the triangles face; zero if there is no such cone
  float cone_cutoff;     ///< sine of the cone's half angle, and a little; 1 if there is no cone
} umbel_cluster_bounds;

/// Bounding sphere and normal cone of each cluster, for culling: bounds[0 .. range_count).
/// `capacity` must be at least as large. `input` and `clusters` as for umbel_cluster_order.
UMBEL_C_API umbel_result umbel_cluster_get_bounds(const umbel_cluster_input* input,
                                                  const umbel_cluster_output* clusters,
                                                  const umbel_build_options* options,
                                                  umbel_cluster_bounds* bounds, size_t capacity);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_CLUSTER_H
