// Continuous level of detail from C: building it, and selecting what to draw. C99.
//
//   umbel_lod_mesh mesh;
//   umbel_lod_mesh_init(&mesh);
//   mesh.positions = positions;
//   mesh.position_count = vertex_count;
//   mesh.triangles = indices;
//   mesh.triangle_count = triangle_count;
//
//   umbel_lod* lod;
//   if (umbel_lod_build(&mesh, NULL, NULL, &lod) != UMBEL_OK) puts(umbel_last_error());
//
//   umbel_lod_view view;
//   umbel_lod_view_camera(eye, fov_y, height, pixel_error, &view);
//   size_t count;
//   umbel_lod_select(umbel_lod_get_tables(lod), &view, NULL, UMBEL_LOD_HIERARCHY, NULL, 0, &count);
//   uint32_t* cut = malloc(count * sizeof *cut);
//   umbel_lod_select(umbel_lod_get_tables(lod), &view, NULL, UMBEL_LOD_HIERARCHY, cut, count,
//                    &count);
//   umbel_lod_free(lod);
//
// docs/lod.md explains what is built; docs/selection.md specifies what is selected, to the last
// bit. Objects and their arrays live until the matching _free. Any number of threads may use the
// same object at once.
#ifndef UMBEL_UMBEL_LOD_H
#define UMBEL_UMBEL_LOD_H

#include "umbel/umbel_cluster.h"

#ifdef __cplusplus
extern "C" {
#endif

// ---- building ----------------------------------------------------------------------------------

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
                                     ///< open, or have more than two triangles, that must not
  UMBEL_LOD_REFUSED_TAKEN_EDGE = 5   ///< another group has made the same new edge between two
                                     ///< locked vertices: this group may make none at all
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

  size_t most;  ///< triangles that may be left at most: 85 % of the group's
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
  uint32_t min_group;         ///< [24] clusters that are simplified together
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

// ---- tables ------------------------------------------------------------------------------------

typedef struct umbel_lod_group {
  umbel_range clusters;
  uint32_t level;   ///< 0 is the finest
  uint32_t method;  ///< 0 regular, 1 permissive, 2 prune, 3 sloppy, 4 root
  umbel_sphere sphere;
  /// How far the group's simplified form may be from the source, in the mesh's unit. INFINITY
  /// exactly for roots, which are never simplified and so always shown at the least.
  float error;
} umbel_lod_group;

typedef struct umbel_lod_cluster {
  uint32_t group;
  uint32_t generating_group;  ///< UMBEL_NONE at level 0
  uint32_t material;
  uint32_t vertex_count, triangle_count;
  umbel_aabb box;
} umbel_lod_cluster;

typedef struct umbel_lod_node {
  umbel_sphere sphere;
  float error;
  uint32_t group;  ///< UMBEL_NONE for an inner node
  umbel_range children;
} umbel_lod_node;

/// All that selection needs.
typedef struct umbel_lod_arrays {
  uint32_t struct_size;
  uint32_t reserved;          ///< 0
  const umbel_range* levels;  ///< of groups, finest first
  size_t level_count;
  const umbel_lod_group* groups;
  size_t group_count;
  const umbel_lod_cluster* clusters;
  size_t cluster_count;
  const umbel_lod_node* nodes;
  size_t node_count;
} umbel_lod_arrays;
UMBEL_STRUCT_INIT(umbel_lod_arrays)

typedef struct umbel_lod_tables umbel_lod_tables;

/// Those of a build; they live as long as it. NULL for NULL.
UMBEL_C_API const umbel_lod_tables* umbel_lod_get_tables(const umbel_lod* lod);
/// Those of a file.
UMBEL_C_API umbel_result umbel_lod_tables_open(const char* path, umbel_lod_tables** tables);
/// A checked copy of arrays from anywhere; UMBEL_ERROR_CORRUPT where an index leads nowhere. Where
/// there are no nodes (node_count 0), the hierarchy is built; where there are no levels, they are
/// made from the groups', which then must not fall from one group to the next.
UMBEL_C_API umbel_result umbel_lod_tables_create(const umbel_lod_arrays* arrays,
                                                 umbel_lod_tables** tables);
/// Of tables that were opened or created.
UMBEL_C_API void umbel_lod_tables_free(umbel_lod_tables* tables);
/// The arrays, which stay the library's.
UMBEL_C_API umbel_result umbel_lod_tables_arrays(const umbel_lod_tables* tables,
                                                 umbel_lod_arrays* arrays);

// ---- selection ---------------------------------------------------------------------------------

typedef enum umbel_lod_view_kind {
  UMBEL_LOD_BY_ERROR = 0,
  UMBEL_LOD_BY_CAMERA = 1,
  UMBEL_LOD_BY_LEVEL = 2
} umbel_lod_view_kind;

/// What decides whether a group must be refined; made by one of the three functions below.
typedef struct umbel_lod_view {
  uint32_t kind;  ///< umbel_lod_view_kind
  float error;
  umbel_vec3 eye;
  float threshold;
  uint32_t level;
} umbel_lod_view;

UMBEL_C_API umbel_result umbel_lod_view_error(float error, umbel_lod_view* view);
/// A group is refined where its error, seen from the point of its sphere that is nearest to `eye`,
/// covers more than `pixel_error` pixels: error / distance * height / (2 tan(fov_y / 2)), that is
/// umbel_pixel_error. (The error-over-distance of NVIDIA's nvclusterlod leaves the 2 out: it counts
/// the same error as twice as many pixels.) `fov_y` is the vertical field of view in radians, above
/// 0 and below pi; `height` that of the picture in pixels.
UMBEL_C_API umbel_result umbel_lod_view_camera(const float eye[3], float fov_y, uint32_t height,
                                               float pixel_error, umbel_lod_view* view);
UMBEL_C_API umbel_result umbel_lod_view_level(uint32_t level, umbel_lod_view* view);

typedef struct umbel_lod_culling {
  const umbel_plane* planes;  ///< clusters wholly outside one of them are left out
  size_t plane_count;
  const umbel_cluster_bounds*
      normal_cones;  ///< one a cluster, or NULL: those that face away are left out
  size_t normal_cone_count;
} umbel_lod_culling;

/// left, right, bottom, top, near and, if far_plane is finite, far.
UMBEL_C_API umbel_result umbel_lod_frustum(const float eye[3], const float target[3],
                                           const float up[3], float fov_y, float aspect,
                                           float near_plane, float far_plane, umbel_plane planes[6],
                                           size_t* count);
/// Spheres and cones of all clusters: bounds[0 .. clusters). `capacity` must be as large.
UMBEL_C_API umbel_result umbel_lod_normal_cones(const umbel_lod* lod,
                                                const umbel_build_options* options,
                                                umbel_cluster_bounds* bounds, size_t capacity);

typedef enum umbel_lod_method {
  UMBEL_LOD_FLAT = 0,
  UMBEL_LOD_HIERARCHY = 1,
  UMBEL_LOD_BREADTH_FIRST = 2
} umbel_lod_method;

/// The clusters of the cut, ascending, the same for every method. `culling` may be NULL. *count is
/// how many there are; with `cut` NULL nothing is written, and where `capacity` is too small the
/// result is UMBEL_ERROR_CAPACITY.
UMBEL_C_API umbel_result umbel_lod_select(const umbel_lod_tables* tables,
                                          const umbel_lod_view* view,
                                          const umbel_lod_culling* culling, umbel_lod_method method,
                                          uint32_t* cut, size_t capacity, size_t* count);

/// A cut for each instance, with view and planes of the scene: instance i has
/// clusters[offsets[i] .. offsets[i + 1]). `offsets` has room for instance_count + 1.
UMBEL_C_API umbel_result umbel_lod_select_instances(
    const umbel_lod_tables* tables, const umbel_lod_view* view, const umbel_lod_culling* culling,
    const umbel_transform* instances, size_t instance_count, uint32_t* offsets, uint32_t* clusters,
    size_t capacity, size_t* count);

typedef enum umbel_lod_budget_unit {
  UMBEL_LOD_TRIANGLES = 0,
  UMBEL_LOD_CLUSTERS = 1,
  UMBEL_LOD_GROUPS = 2,  ///< groups with a cluster in the cut
  UMBEL_LOD_COSTS = 3    ///< of cluster_costs and group_costs
} umbel_lod_budget_unit;

/// How much a cut may cost. What is culled costs nothing.
typedef struct umbel_lod_budget {
  uint32_t struct_size;
  uint32_t unit;                  ///< umbel_lod_budget_unit
  uint64_t limit;                 ///< UMBEL_NO_LIMIT: as much as the view asks for
  const uint32_t* cluster_costs;  ///< with UMBEL_LOD_COSTS: one a cluster, or NULL: nothing
  size_t cluster_cost_count;
  const uint32_t* group_costs;  ///< likewise: for a group with any cluster in the cut
  size_t group_cost_count;
} umbel_lod_budget;
UMBEL_STRUCT_INIT(umbel_lod_budget)

/// The finest view, by error or camera, not finer than `view`, whose cut is within the budget;
/// where none is, that of the coarsest cut. `culling` and `instances` may be NULL.
UMBEL_C_API umbel_result umbel_lod_view_for_budget(const umbel_lod_tables* tables,
                                                   const umbel_lod_view* view,
                                                   const umbel_lod_budget* budget,
                                                   const umbel_lod_culling* culling,
                                                   const umbel_transform* instances,
                                                   size_t instance_count, umbel_lod_view* result);

/// The cut of that view, and then, since it leaves unused what the next group would take too much
/// of, the groups that still fit, refined one by one, the worst error first. No view selects such a
/// cut, but it is as whole as others. Arrays as for umbel_lod_select_instances; without instances
/// `offsets` has room for two. *cost (NULL: not wanted) is what the cut costs: over the limit only
/// where no cut is within it.
UMBEL_C_API umbel_result umbel_lod_select_for_budget(
    const umbel_lod_tables* tables, const umbel_lod_view* view, const umbel_lod_budget* budget,
    const umbel_lod_culling* culling, const umbel_transform* instances, size_t instance_count,
    uint32_t* offsets, uint32_t* clusters, size_t capacity, size_t* count, uint64_t* cost);

/// asin(error / distance), pi / 2 from where the distance is not larger; NaN for a negative error.
UMBEL_C_API double umbel_angular_error(double error, double distance);
/// Pixels that an error covers at the centre of a picture: error / distance * height /
/// (2 tan(fov_y / 2)); NaN for a negative error.
UMBEL_C_API double umbel_pixel_error(double error, double distance, double fov_y, uint32_t height);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_LOD_H
