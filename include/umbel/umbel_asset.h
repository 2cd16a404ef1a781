// Assets (.umbel files) from C, and streaming them: which pages are in memory, under a budget of
// bytes, as cameras move. C99.
//
//   umbel_asset* asset;
//   if (umbel_asset_open("dragon.umbel", &asset) != UMBEL_OK) puts(umbel_last_error());
//   umbel_asset_info info;
//   umbel_asset_info_init(&info);
//   umbel_asset_get_info(asset, &info);
//   umbel_residency* residency;
//   umbel_residency_create(asset, NULL, &residency);
//   const umbel_vec3 local = umbel_relative_to(info.origin, eye);  // in the mesh's space
//   const float eye_in_mesh[3] = {local.x, local.y, local.z};
//   umbel_stream_view view = {0};                                  // the first mesh
//   umbel_lod_view_camera(eye_in_mesh, fov_y, height, 1, &view.view);  // errors of a pixel
//   umbel_stream_step step;
//   umbel_stream_step_init(&step);
//   umbel_residency_step(residency, &view, 1, seconds, &step);     // each frame
//   umbel_residency_cut(residency, clusters, capacity, &count);    // what to draw
//   umbel_residency_cluster(residency, &clusters[i], &geometry);
//   umbel_residency_free(residency);
//   umbel_asset_free(asset);
#ifndef UMBEL_UMBEL_ASSET_H
#define UMBEL_UMBEL_ASSET_H

#include "umbel/umbel_lod.h"

#ifdef __cplusplus
extern "C" {
#endif

// ---- assets ------------------------------------------------------------------------------------

/// An open .umbel file. Any number of threads may use it at once.
typedef struct umbel_asset umbel_asset;

/// Reads `size` bytes from `offset` on into `out`; returns 0 on success. Called by many threads at
/// once.
typedef int (*umbel_read)(void* user, uint64_t offset, uint64_t size, void* out);

/// Opens a file; reads its file header only. `path` is UTF-8. *asset is NULL on failure, else to be
/// freed.
UMBEL_C_API umbel_result umbel_asset_open(const char* path, umbel_asset** asset);

/// Opens a source of `size` bytes, which `read` reads. `read` and `user` must live until the asset
/// is freed.
UMBEL_C_API umbel_result umbel_asset_open_source(uint64_t size, umbel_read read, void* user,
                                                 umbel_asset** asset);

UMBEL_C_API void umbel_asset_free(umbel_asset* asset);

typedef struct umbel_asset_info {
  uint32_t struct_size;
  uint32_t version_major, version_minor;
  uint32_t pages, meshes, instances;
  uint32_t max_triangles, max_vertices;  ///< limits that every cluster keeps
  uint64_t file_bytes, header_bytes;     ///< of the file, and of what opening reads
  uint64_t checksum;                     ///< of the whole file
  uint64_t source_triangles;             ///< of all meshes
  umbel_aabb bounds;                     ///< relative to origin; min > max where there is nothing
  umbel_vec3d origin;                    ///< points of the asset are at origin + point
} umbel_asset_info;
UMBEL_STRUCT_INIT(umbel_asset_info)

UMBEL_C_API umbel_result umbel_asset_get_info(const umbel_asset* asset, umbel_asset_info* info);

// ---- residency ---------------------------------------------------------------------------------

/// Pages of an asset in memory. One thread at a time may use it. The asset must outlive it.
typedef struct umbel_residency umbel_residency;

/// How to stream. The defaults in brackets are those of umbel_residency_config_init. In all whole
/// numbers but `threads`, UMBEL_NO_LIMIT is no limit.
typedef struct umbel_residency_config {
  uint32_t struct_size;
  uint32_t threads;             ///< that read and decode pages, at least 1 [2]
  uint64_t budget_bytes;        ///< most bytes of pages in memory [256 MiB]
  uint64_t bytes_per_step;      ///< most bytes taken over in a step, at least one page [8 MiB]
  uint32_t loads_in_flight;     ///< most pages requested and not arrived [8]
  uint32_t evictions_per_step;  ///< [64]
  uint32_t groups_per_step;     ///< groups that a step tests, about [4096]
  /// A page that is shown is evicted only for one of so many times its priority, at least 1 [1.5].
  /// The larger, the less a camera that moves to and fro loads the same pages again and again.
  float hysteresis;
  uint32_t attempts;       ///< to load a page, before its region stays coarse [5]
  double backoff_seconds;  ///< after the first failure, doubled after each further one [0.1]
  double slow_seconds;     ///< a load that takes longer counts as failed [10]
} umbel_residency_config;

UMBEL_C_API void umbel_residency_config_init_sized(umbel_residency_config* config, size_t size);
static inline void umbel_residency_config_init(umbel_residency_config* config) {
  umbel_residency_config_init_sized(config, sizeof *config);
}

/// `config` NULL: the defaults. Reads the pages of the coarsest groups at once, which must fit the
/// budget (UMBEL_ERROR_INVALID_ARGUMENT).
UMBEL_C_API umbel_result umbel_residency_create(const umbel_asset* asset,
                                                const umbel_residency_config* config,
                                                umbel_residency** residency);

/// Waits for loads in progress.
UMBEL_C_API void umbel_residency_free(umbel_residency* residency);

/// One mesh as somebody sees it: by error or by camera, in the mesh's own space, relative to the
/// asset's origin.
typedef struct umbel_stream_view {
  uint32_t mesh;
  umbel_lod_view view;
  /// Those of a frustum, as umbel_lod_frustum makes them, in the same space, or NULL: what lies
  /// outside one of them is shown as coarse as possible, and loads last.
  const umbel_plane* planes;
  size_t plane_count;
} umbel_stream_view;

typedef struct umbel_stream_step {
  uint32_t struct_size;
  float worst_error;  ///< in units of what its view allows; 0 if nothing is missing
  uint32_t open_groups, missing_groups, loaded, evicted, requested, cancelled;
  uint64_t resident_bytes;
  uint64_t failures;   ///< of loads, in all steps
  uint32_t evaluated;  ///< groups tested in this step
  uint32_t caught_up;  ///< 0: some groups remain to be tested; the next step goes on
} umbel_stream_step;
UMBEL_STRUCT_INIT(umbel_stream_step)

/// Takes over pages that have arrived, updates the cut for these views, and requests missing pages.
/// `seconds` is the time on any clock that does not run backwards. After UMBEL_ERROR_OUT_OF_MEMORY
/// the cut is empty until the next step, which begins again with the pages in memory.
UMBEL_C_API umbel_result umbel_residency_step(umbel_residency* residency,
                                              const umbel_stream_view* views, size_t view_count,
                                              double seconds, umbel_stream_step* step);

/// A cluster of a cut: the index of its view, and cluster `cluster` of group `group` of a page.
typedef struct umbel_stream_cluster {
  uint32_t view, page, group, cluster;
} umbel_stream_cluster;

/// The clusters that the views of the last step show. *count is their number, also if they do not
/// fit (UMBEL_ERROR_CAPACITY).
UMBEL_C_API umbel_result umbel_residency_cut(const umbel_residency* residency,
                                             umbel_stream_cluster* clusters, size_t capacity,
                                             size_t* count);

/// A decoded cluster. Arrays are the caller's, for at least 256 vertices and 256 triangles; NULL:
/// not wanted.
typedef struct umbel_cluster_geometry {
  uint32_t struct_size;
  uint32_t vertex_count, triangle_count, material;
  umbel_vec3* positions;
  umbel_vec3* normals;  ///< not written if the asset has none
  uint8_t* triangles;   ///< three vertex indices a triangle
} umbel_cluster_geometry;
UMBEL_STRUCT_INIT(umbel_cluster_geometry)

/// Decodes a cluster of a page that is loaded, as those of the last cut are.
/// UMBEL_ERROR_INVALID_ARGUMENT where it is not, or has no such cluster.
UMBEL_C_API umbel_result umbel_residency_cluster(const umbel_residency* residency,
                                                 const umbel_stream_cluster* cluster,
                                                 umbel_cluster_geometry* geometry);

// ---- pages -------------------------------------------------------------------------------------

/// A page in memory, checked. Its asset must outlive it; its residency need not.
typedef struct umbel_page umbel_page;

/// Reads a page; umbel_asset_info.pages says how many there are. *page is NULL on failure, else to
/// be freed.
UMBEL_C_API umbel_result umbel_asset_read_page(const umbel_asset* asset, uint32_t number,
                                               umbel_page** page);
/// A page that is in memory, without a copy; UMBEL_ERROR_INVALID_ARGUMENT where it is not.
UMBEL_C_API umbel_result umbel_residency_get_page(const umbel_residency* residency, uint32_t number,
                                                  umbel_page** page);
UMBEL_C_API void umbel_page_free(umbel_page* page);

/// A group of a page: clusters first_cluster up to first_cluster + cluster_count of the mesh's
/// tables, which are those from page_cluster on in the page's geometry.
typedef struct umbel_page_group {
  uint32_t mesh, group;
  uint32_t first_cluster, cluster_count;
  uint32_t page_cluster;
} umbel_page_group;

/// The groups of a page, in the order of umbel_stream_cluster.group. With `groups` NULL only *count
/// is written.
UMBEL_C_API umbel_result umbel_page_get_groups(const umbel_page* page, umbel_page_group* groups,
                                               size_t capacity, size_t* count);

/// The geometry of all clusters of a page, as umbel_lod_get_geometry gives it. Where the page's
/// meshes have different further attributes, `extra_values` must be NULL
/// (UMBEL_ERROR_UNSUPPORTED).
UMBEL_C_API umbel_result umbel_page_get_geometry(const umbel_page* page,
                                                 const umbel_build_options* options,
                                                 umbel_lod_geometry* geometry);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_ASSET_H
