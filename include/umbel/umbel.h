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
  UMBEL_ERROR_INTERNAL = 9  ///< a fault of the library itself
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
// umbel_cluster_config_init_sized for the one struct whose defaults are not zero.

typedef struct umbel_vec3 {
  float x, y, z;
} umbel_vec3;

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
  /// umbel_cluster_config.max_vertices, for `shared_vertex_weight` and with `positions`.
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

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_H
