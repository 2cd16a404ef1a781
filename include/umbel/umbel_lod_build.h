// Building continuous levels of detail from C, saving and verifying them, and their geometry. C99.
// umbel_lod.h has an example; docs/lod.md explains what is built.
#ifndef UMBEL_UMBEL_LOD_BUILD_H
#define UMBEL_UMBEL_LOD_BUILD_H

#include "umbel/umbel_cluster.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum umbel_extra_kind {
  UMBEL_EXTRA_UVS = 4,      ///< 2 values: texture coordinates of the set 1, 2, ...
  UMBEL_EXTRA_JOINTS = 16,  ///< 4: whole numbers of joints; sets 0, 1, ...
  UMBEL_EXTRA_WEIGHTS = 32  ///< 4: how much the joints of the same set move the vertex
} umbel_extra_kind;

/// An attribute besides those that umbel_lod_mesh names.
typedef struct umbel_extra {
  uint32_t kind;  ///< umbel_extra_kind
  uint32_t set;   ///< at most 255
} umbel_extra;

/// Triangles with attributes. All but positions and triangles may be NULL.
typedef struct umbel_lod_mesh {
  uint32_t struct_size;
  uint32_t reserved;            ///< 0
  const umbel_vec3* positions;  ///< `position_count`, as all streams of vertices
  size_t position_count;
  const uint32_t* triangles;  ///< 3 a triangle, counter-clockwise from outside
  size_t triangle_count;
  const umbel_vec3* normals;
  const umbel_vec4* tangents;  ///< w = -1 or 1
  const umbel_vec2* uvs;
  const umbel_vec4* colors;   ///< linear RGBA in [0, 1]
  const uint32_t* materials;  ///< one a triangle
  /// Further attributes, rising by kind and set, of at most 40 values together, and for each vertex
  /// the values of all of them, in this order.
  const umbel_extra* extras;
  size_t extra_count;
  const float* extra_values;
  /// Bytes from the values of one vertex to those of the next, so that all may lie in one buffer;
  /// any alignment. 0: one right after the other, as in all meshes that the library gives out.
  size_t position_stride, normal_stride, tangent_stride, uv_stride, color_stride, extra_stride;
  /// One a vertex, or NULL. Where it is not 0, everything at the vertex's position stays in every
  /// cut: the position, and the open edges between two such positions. See
  /// umbel_lod_config.lock_borders for all open edges.
  const uint8_t* locked;
} umbel_lod_mesh;
UMBEL_STRUCT_INIT(umbel_lod_mesh)

/// Why the library could not use what a decimation gave.
typedef enum umbel_lod_refusal {
  UMBEL_LOD_NOT_REFUSED = 0,         ///< the first call for the group
  UMBEL_LOD_REFUSED_TOO_MANY = 1,    ///< more than `most` triangles
  UMBEL_LOD_REFUSED_DEGENERATE = 2,  ///< a triangle has two corners at one position
  UMBEL_LOD_REFUSED_MATERIALS = 3,   ///< a triangle has corners of several materials
  UMBEL_LOD_REFUSED_EDGES = 4,       ///< edges of the group's border are missing, or edges are
                                     ///< open, or have more than two triangles, or triangles that
                                     ///< run the wrong way along them, that must not
  UMBEL_LOD_REFUSED_TAKEN_EDGE = 5,  ///< another group has made the same new edge between two
                                     ///< locked vertices: this group may make none at all
  UMBEL_LOD_REFUSED_TURNED_OVER = 6  ///< a connected component faces the other way
} umbel_lod_refusal;

/// One group for a decimation of the caller's own, see umbel_lod_config.
typedef struct umbel_lod_decimation {
  umbel_lod_mesh mesh;    ///< the group's vertices, numbered from 0, and triangles
  const uint8_t* locked;  ///< one a vertex: 1 where it must stay, as must border edges between such
  size_t target;          ///< triangles that should be left

  uint32_t* triangles;    ///< out: 3 a triangle; there is room for as many as mesh has
  size_t triangle_count;  ///< out
  float error;            ///< out: how far the surface moved at most
  uint32_t reserved;      ///< 0
  /// out: new vertices, numbered from mesh.position_count on, in every stream that mesh has; there
  /// is room for as many as mesh has. Materials (one a vertex) matter where mesh has several.
  umbel_vec3* added_positions;
  umbel_vec3* added_normals;
  umbel_vec4* added_tangents;
  umbel_vec2* added_uvs;
  umbel_vec4* added_colors;
  uint32_t* added_materials;
  size_t added_count;  ///< out
  float* added_extra_values;

  size_t most;  ///< triangles that may be left at most: 85 % of the group's, or `ratio` if more
  /// umbel_lod_refusal: why the result of the last call for this group was refused. The arrays for
  /// the answer are empty again.
  uint32_t refusal;
  uint32_t refused_triangle;  ///< of that result, or UMBEL_NONE
  const char* refused_why;    ///< the same in a sentence, or NULL
  /// With UMBEL_LOD_REFUSED_EDGES: pairs of vertices, as the result numbered them. Of several at
  /// one position it is the first.
  const uint32_t* refused_edges;
  size_t refused_edge_count;
} umbel_lod_decimation;

/// What a decimation returns to end the build with UMBEL_ERROR_CANCELLED.
#define UMBEL_LOD_DECIMATE_CANCEL (-1)

/// Returns a positive number if it simplified the group, 0 to leave it to the library, a negative
/// one to cancel the build. A result that cannot take the group's place is refused, and the
/// function called again, told why, up to four times in all: it may mend the result, or return 0.
/// Called by several threads at once unless umbel_build_options.threads is 1.
typedef int (*umbel_lod_decimate)(umbel_lod_decimation* group, void* user);

typedef enum umbel_seam_rule {
  UMBEL_SEAM_PROTECT = 0,  ///< shortens along itself only, until nothing else is left to simplify
  UMBEL_SEAM_ALLOW = 1,    ///< what it costs the attributes to cross it counts as error
  UMBEL_SEAM_IGNORE = 2    ///< crossing costs nothing
} umbel_seam_rule;

/// How to build. The defaults in brackets are those of umbel_lod_config_init.
typedef struct umbel_lod_config {
  uint32_t struct_size;
  uint32_t max_triangles;     ///< [128] a cluster, 4..256; UMBEL_NO_LIMIT: 256
  uint32_t max_vertices;      ///< [128] a cluster, 6..256; UMBEL_NO_LIMIT: 256
  uint32_t min_group;         ///< [24] clusters that are simplified together, at least 2
  uint32_t max_group;         ///< [32] at most 1024
  float ratio;                ///< [0.5] triangles that each level keeps, in [0.1, 0.9]
  float position_step;        ///< [0] positions are snapped to multiples of this power of two
  uint32_t attributes;        ///< [1] nonzero: attributes weigh in the error, seams are kept
  float normal_weight;        ///< [0.5] in [0, 1000], as the other weights
  float uv_weight;            ///< [0.5]
  float color_weight;         ///< [0.5]
  uint32_t refit_attributes;  ///< [1] nonzero: vertices that stay take the attributes that fit best
                              ///< to all vertices that they replace
  uint32_t max_levels;        ///< [UMBEL_NO_LIMIT]
  float max_error;            ///< [infinity] no group gets a larger error
  uint64_t stop_triangles;    ///< [0] stop as soon as no more than these are left
  uint32_t
      measured_error;  ///< [0] nonzero: errors are distances to the source, measured by samples
  uint32_t reserved;   ///< 0
  umbel_lod_decimate decimate;  ///< [NULL]
  void* decimate_user;          ///< handed to `decimate`
  /// [1] umbel_seam_rule of where texture coordinates or colours differ at one position, and of
  /// where only normals do. Borders between materials are always kept.
  uint32_t seams, creases;
  float tangent_weight;    ///< [0.25]
  float skin_weight;       ///< [0.5] of how much each joint moves a vertex
  uint32_t mix_materials;  ///< [0] nonzero: clusters may mix materials, kept triangle by triangle
  uint32_t keep_area;      ///< [1] nonzero: many small components are enlarged where they lose area
  /// [0] nonzero: open edges of the mesh (of one triangle, by position) stay as they are in every
  /// cut, so that parts of a larger mesh that are built apart join without a crack, whatever cut
  /// each shows. Coarse levels cannot have fewer triangles than that needs.
  uint32_t lock_borders;
  /// [0] Least triangles of a cluster, where materials and max_vertices allow it, at most
  /// max_triangles; 0: a quarter of them.
  uint32_t min_triangles;
  /// [0.3, 0.5, 0] in [0, 1]: what clusters cost that have too few triangles or vertices, and
  /// splits whose sides overlap, as in umbel_cluster_config.
  float underfill_cost, vertex_underfill_cost, overlap_cost;
  /// [0.5, 0] in [0, 1]: the same of groups that have too few clusters, and of groups that overlap.
  float group_underfill_cost, group_overlap_cost;
  uint32_t reserved2;  ///< 0
} umbel_lod_config;

/// What was built.
typedef struct umbel_lod_report {
  uint32_t struct_size;
  uint32_t root_groups;
  uint32_t stuck_groups;  ///< all roots, if more than one cluster's worth of triangles or vertices
                          ///< is left though the configuration did not ask to stop
  uint32_t levels;
  uint64_t input_triangles, input_vertices, degenerate_triangles, root_triangles;
  /// Groups by simplification method: regular, permissive, prune, sloppy, root.
  uint64_t groups_by_method[5];
  double seconds;
  /// The same [method][umbel_lod_limiting_factor], and how often groups waited for the next round,
  /// by limiting factor.
  uint64_t groups_by_limiting_factor[5][13];
  uint64_t waits_by_limiting_factor[13];
  /// With `measured_error`, over the groups that have a distance to the source: the mean of
  /// log2(estimate by quadrics / measured distance), and how many were estimated too small.
  double mean_log2_overestimate;
  uint64_t measured_groups, underestimated_groups;
} umbel_lod_report;
UMBEL_STRUCT_INIT(umbel_lod_report)

/// Why a group was not simplified to 70 % by the first method alone, or is a root: what kept most
/// of its vertices from moving.
typedef enum umbel_lod_limiting_factor {
  UMBEL_LOD_LIMIT_NONE = 0,              ///< the first method was enough
  UMBEL_LOD_LIMIT_CALLER = 1,            ///< the caller's decimation did it
  UMBEL_LOD_LIMIT_SMALL_COMPONENTS = 2,  ///< small components were kept at a high cost
  UMBEL_LOD_LIMIT_LOCKED = 3,            ///< other groups share them, or the caller locked them
  UMBEL_LOD_LIMIT_NON_MANIFOLD = 4,      ///< non-manifold vertices
  UMBEL_LOD_LIMIT_SEAMS = 5,             ///< rules of seams and creases, borders between materials
  UMBEL_LOD_LIMIT_TOPOLOGY = 6,          ///< any move would make the surface non-manifold
  UMBEL_LOD_LIMIT_FLIP = 7,              ///< any move would flip a triangle
  UMBEL_LOD_LIMIT_COST = 8,              ///< any move costs several times as much as before
  UMBEL_LOD_LIMIT_COARSEST = 9,          ///< a root: no more than one cluster's worth was left
  UMBEL_LOD_LIMIT_STOPPED = 10,          ///< a root: the configuration said where to stop
  UMBEL_LOD_LIMIT_STUCK = 11,            ///< a root: nothing could be simplified any more
  UMBEL_LOD_LIMIT_AREA_LOST = 12         ///< many small components lost area and were enlarged
} umbel_lod_limiting_factor;

typedef struct umbel_lod umbel_lod;

/// Sets the first `size` bytes of a config to the defaults.
UMBEL_C_API void umbel_lod_config_init_sized(umbel_lod_config* config, size_t size);

static inline void umbel_lod_config_init(umbel_lod_config* config) {
  umbel_lod_config_init_sized(config, sizeof *config);
}

/// Builds the levels of detail of a mesh. `config` and `options` may be NULL. *lod is NULL after
/// any failure.
UMBEL_C_API umbel_result umbel_lod_build(const umbel_lod_mesh* mesh, const umbel_lod_config* config,
                                         const umbel_build_options* options, umbel_lod** lod);
UMBEL_C_API void umbel_lod_free(umbel_lod* lod);

UMBEL_C_API umbel_result umbel_lod_get_report(const umbel_lod* lod, umbel_lod_report* report);
/// The umbel_lod_limiting_factor of every group. *count is how many there are; with
/// `limiting_factors` NULL nothing is written, and where `capacity` is too small the result is
/// UMBEL_ERROR_CAPACITY.
UMBEL_C_API umbel_result umbel_lod_get_limiting_factors(const umbel_lod* lod,
                                                        uint32_t* limiting_factors, size_t capacity,
                                                        size_t* count);

/// Writes a .umbel file beside `path` and renames it. `exact`: keep every bit of the attributes.
UMBEL_C_API umbel_result umbel_lod_save(const umbel_lod* lod, const char* path, int exact,
                                        const umbel_build_options* options);
/// The same for positions that are relative to `origin`, a point of the world.
UMBEL_C_API umbel_result umbel_lod_save_at(const umbel_lod* lod, const char* path, int exact,
                                           umbel_vec3d origin, const umbel_build_options* options);

/// How a .umbel file is written: AssetConfig of umbel/asset.hpp. The defaults in brackets are those
/// of umbel_lod_save_config_init; bits of 0, and a step of 0, keep floats unchanged.
typedef struct umbel_lod_save_config {
  uint32_t struct_size;
  uint32_t normal_bits;   ///< [10] of each of two octahedral components, 2..16
  uint32_t tangent_bits;  ///< [10] of the angle about the normal, 2..16; needs normal_bits
  uint32_t color_bits;    ///< [8] of red, green, blue (as sRGB) and alpha, 2..16
  float uv_step;          ///< [2^-14] texture coordinates become multiples of this power of two
  uint32_t page_bytes;    ///< [0] a multiple of 4096, up to 1 GiB; 0: 40 to 256 KiB, as it grows
  umbel_vec3d origin;     ///< [0] the point of the world that positions are relative to
} umbel_lod_save_config;

UMBEL_C_API void umbel_lod_save_config_init_sized(umbel_lod_save_config* config, size_t size);
static inline void umbel_lod_save_config_init(umbel_lod_save_config* config) {
  umbel_lod_save_config_init_sized(config, sizeof *config);
}
/// Writes a .umbel file beside `path` and renames it. `config` and `options` may be NULL.
UMBEL_C_API umbel_result umbel_lod_save_with(const umbel_lod* lod, const char* path,
                                             const umbel_lod_save_config* config,
                                             const umbel_build_options* options);

/// Verifies the DAG with that many random cuts; UMBEL_ERROR_CORRUPT and a sentence if it is wrong.
UMBEL_C_API umbel_result umbel_lod_verify(const umbel_lod* lod, uint32_t cuts, uint32_t seed,
                                          const umbel_build_options* options);

/// Which arrays of a umbel_lod_geometry there is something for.
typedef enum umbel_lod_stream {
  UMBEL_LOD_NORMALS = 1,
  UMBEL_LOD_TANGENTS = 2,
  UMBEL_LOD_UVS = 4,
  UMBEL_LOD_COLORS = 8,
  UMBEL_LOD_EXTRAS = 16,
  UMBEL_LOD_SOURCE_VERTICES = 32
} umbel_lod_stream;

/// The geometry of many clusters as a structure of arrays, all of them the caller's. An array that
/// is NULL is not wanted; one that is not must have the room that the capacities say. Cluster i has
/// the vertices vertex_offsets[i] up to vertex_offsets[i + 1], and the triangles likewise. A
/// triangle is three bytes, numbers of vertices of its own cluster: with at most 256 vertices and
/// triangles a cluster, these are the layouts that mesh shaders (VK_EXT_mesh_shader) and cluster
/// acceleration structures (VK_NV_cluster_acceleration_structure, DXR 1.2) take: positions as three
/// floats 12 bytes apart, indices as bytes. See examples/c/3_cluster_structures.c.
typedef struct umbel_lod_geometry {
  uint32_t struct_size;
  uint32_t streams;      ///< out: umbel_lod_stream, those that there are
  size_t cluster_count;  ///< out, as the next two: how many there are
  size_t vertex_count;
  size_t triangle_count;
  size_t cluster_capacity;     ///< in: room for the arrays of clusters; offsets need one more
  size_t vertex_capacity;      ///< in: for those of vertices
  size_t triangle_capacity;    ///< in: for those of triangles
  uint32_t* vertex_offsets;    ///< cluster_count + 1
  uint32_t* triangle_offsets;  ///< cluster_count + 1, in triangles
  uint32_t* materials;         ///< cluster_count
  umbel_vec3* positions;       ///< vertex_count, as the following
  umbel_vec3* normals;
  umbel_vec4* tangents;
  umbel_vec2* uvs;
  umbel_vec4* colors;
  float* extra_values;  ///< vertex_count times extra_width
  size_t extra_width;   ///< out: values of further attributes a vertex
  /// The vertex of the umbel_lod_mesh that each vertex is, so that a renderer can keep its own
  /// vertex buffer; UMBEL_NONE where it is new. Not of files, which do not keep it.
  uint32_t* source_vertices;
  uint8_t* triangles;            ///< three a triangle
  uint32_t* triangle_materials;  ///< one a triangle; as `materials` unless clusters mix them
} umbel_lod_geometry;
UMBEL_STRUCT_INIT(umbel_lod_geometry)

/// The geometry of clusters[0 .. count), or of all clusters in their order where `clusters` is
/// NULL, in one call. Call it twice: first with all arrays NULL, for the three counts; then with
/// arrays of that size. Where one is too small the result is UMBEL_ERROR_CAPACITY, the counts are
/// right, and nothing else is written.
UMBEL_C_API umbel_result umbel_lod_get_geometry(const umbel_lod* lod, const uint32_t* clusters,
                                                size_t count, const umbel_build_options* options,
                                                umbel_lod_geometry* geometry);

/// A mesh that the library owns.
typedef struct umbel_mesh umbel_mesh;
/// A cut as an ordinary mesh, its clusters joined where they meet.
UMBEL_C_API umbel_result umbel_lod_mesh_of_cut(const umbel_lod* lod, const uint32_t* cut,
                                               size_t count, umbel_mesh** mesh);
/// Its arrays, which stay the library's.
UMBEL_C_API umbel_result umbel_mesh_arrays(const umbel_mesh* mesh, umbel_lod_mesh* arrays);
UMBEL_C_API void umbel_mesh_free(umbel_mesh* mesh);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_LOD_BUILD_H
