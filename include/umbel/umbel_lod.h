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
} umbel_lod_mesh;
UMBEL_STRUCT_INIT(umbel_lod_mesh)

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
} umbel_lod_decimation;

/// Returns nonzero if it simplified the group, 0 to leave it to the library, which also takes over
/// where the result has over 85 % of the triangles or not the group's border. Called by several
/// threads at once unless umbel_build_options.threads is 1.
typedef int (*umbel_lod_decimate)(umbel_lod_decimation* group, void* user);

typedef enum umbel_seam_rule {
  UMBEL_SEAM_PROTECT = 0,  ///< shortens along itself only, until nothing else is left to simplify
  UMBEL_SEAM_ALLOW = 1,    ///< what it costs the attributes to cross it counts as error
  UMBEL_SEAM_IGNORE = 2    ///< crossing costs nothing
} umbel_seam_rule;

/// How to build. The defaults in brackets are those of umbel_lod_config_init.
typedef struct umbel_lod_config {
  uint32_t struct_size;
  uint32_t max_triangles;     ///< [128] a cluster, 4..256
  uint32_t max_vertices;      ///< [128] a cluster, 6..256
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
  uint32_t max_levels;        ///< [0] 0: no limit
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
} umbel_lod_config;

/// What was built.
typedef struct umbel_lod_report {
  uint32_t struct_size;
  uint32_t root_groups;
  uint32_t stuck_groups;  ///< all roots, if more than one cluster's worth of triangles is left
                          ///< though the configuration did not ask to stop
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
  UMBEL_LOD_LIMIT_LOCKED = 3,            ///< other groups share them
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
  float error;  ///< once simplified; infinite for a root
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
/// A checked copy of arrays from anywhere; UMBEL_ERROR_CORRUPT where an index leads nowhere.
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

/// The finest view, by error or camera, not finer than `view`, whose cut costs at most `budget`.
/// `costs` are one a cluster; NULL: their triangles. `culling` and `instances` may be NULL.
UMBEL_C_API umbel_result umbel_lod_view_for_budget(const umbel_lod_tables* tables,
                                                   const umbel_lod_view* view,
                                                   const uint32_t* costs, uint64_t budget,
                                                   const umbel_lod_culling* culling,
                                                   const umbel_transform* instances,
                                                   size_t instance_count, umbel_lod_view* result);

/// asin(error / distance), pi / 2 from where the distance is not larger; NaN for a negative error.
UMBEL_C_API double umbel_angular_error(double error, double distance);
/// error / distance * height / (2 tan(fov_y / 2)); NaN for a negative error.
UMBEL_C_API double umbel_pixel_error(double error, double distance, double fov_y, uint32_t height);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_LOD_H
