// Selecting what to draw of continuous levels of detail from C: the tables of groups, clusters and
// nodes, and the cuts for a view or a budget. C99. docs/selection.md specifies what is selected, to
// the last bit.
#ifndef UMBEL_UMBEL_LOD_SELECT_H
#define UMBEL_UMBEL_LOD_SELECT_H

#include "umbel/umbel_lod_build.h"

#ifdef __cplusplus
extern "C" {
#endif

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

/// A view of the scene in an instance's own space: of umbel_lod_select, of umbel_stream_view. If
/// the transform scales directions differently, it asks for enough detail in all of them.
/// UMBEL_ERROR_INVALID_ARGUMENT where the transform is not finite or, for a camera, not invertible.
UMBEL_C_API umbel_result umbel_lod_view_in_instance(const umbel_lod_view* view,
                                                    const umbel_transform* transform,
                                                    umbel_lod_view* result);
/// The same half-space in an instance's own space.
UMBEL_C_API umbel_result umbel_lod_plane_in_instance(const umbel_plane* plane,
                                                     const umbel_transform* transform,
                                                     umbel_plane* result);

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

#endif  // UMBEL_UMBEL_LOD_SELECT_H
