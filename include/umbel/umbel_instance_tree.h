// Scenes of millions of instances from C: a tree of them in a .umbel file, of which only what a
// view shows is read (docs/instances.md). C99.
//
//   umbel_instance_selector* selector;
//   umbel_instance_selector_create(asset, 64 << 20, &selector);
//   umbel_instance_selector_step(selector, &view, planes, 6, &step);       // each frame; reads
//   umbel_instance_selector_missing(selector, nodes, capacity, &missing);  // nothing
//   umbel_instance_selector_load(selector, nodes, missing < 8 ? missing : 8);
//   umbel_instance_selector_runs(selector, runs, capacity, &count);
//   umbel_instance_selector_placements(selector, &runs[i], instances, capacity, &count);
//
// Views and planes are the scene's, relative to umbel_asset_info.origin.
#ifndef UMBEL_UMBEL_INSTANCE_TREE_H
#define UMBEL_UMBEL_INSTANCE_TREE_H

#include "umbel/umbel_asset.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A mesh in the scene.
typedef struct umbel_instance {
  uint32_t mesh;
  umbel_transform transform;  ///< from the mesh's space to the scene's
} umbel_instance;

/// The instances that an asset lists, umbel_asset_info.instances; where it has a tree of them, the
/// stand-ins of its root. None: each mesh is shown once, untransformed. *count is their number,
/// also with `instances` NULL, or if they do not fit (UMBEL_ERROR_CAPACITY).
UMBEL_C_API umbel_result umbel_asset_get_instances(const umbel_asset* asset,
                                                   umbel_instance* instances, size_t capacity,
                                                   size_t* count);

/// 1 if the asset has a tree of instances; else 0, as for NULL.
UMBEL_C_API int umbel_asset_has_instance_tree(const umbel_asset* asset);

/// Selects from a tree of instances, and keeps pages of it. One thread at a time may use it. The
/// asset must outlive it.
typedef struct umbel_instance_selector umbel_instance_selector;

/// Keeps at most about `max_bytes` of pages that the last step did not show (UMBEL_NO_LIMIT: all).
/// Reads the tree's nodes. UMBEL_ERROR_INVALID_ARGUMENT where the asset has no tree.
UMBEL_C_API umbel_result umbel_instance_selector_create(const umbel_asset* asset, size_t max_bytes,
                                                        umbel_instance_selector** selector);
UMBEL_C_API void umbel_instance_selector_free(umbel_instance_selector* selector);

/// All instances of the tree; 0 for NULL.
UMBEL_C_API uint64_t umbel_instance_selector_instances(const umbel_instance_selector* selector);

/// Instances that a step shows: some of a node's page, or of umbel_asset_get_instances where `node`
/// is UMBEL_NONE.
typedef struct umbel_instance_run {
  uint32_t node;
  umbel_range placements;
  /// Whether the coarsest clusters of their meshes are fine enough; else umbel_lod_view_in_instance
  /// gives the view that says which are.
  uint32_t is_coarsest;
} umbel_instance_run;

typedef struct umbel_instance_step {
  uint32_t struct_size;
  uint32_t reserved;     ///< 0
  size_t run_count;      ///< umbel_instance_selector_runs
  size_t missing_count;  ///< umbel_instance_selector_missing
  uint64_t shown;        ///< instances in all runs
  uint64_t refined;      ///< of these, in runs that are not `is_coarsest`
  uint64_t stand_ins;    ///< of these, that stand for others
} umbel_instance_step;
UMBEL_STRUCT_INIT(umbel_instance_step)

/// What a view by error or camera shows of the pages that are loaded, without what lies outside the
/// planes. Where a page is missing, its node's stand-ins are shown.
UMBEL_C_API umbel_result umbel_instance_selector_step(umbel_instance_selector* selector,
                                                      const umbel_lod_view* view,
                                                      const umbel_plane* planes, size_t plane_count,
                                                      umbel_instance_step* step);
/// A step that misses nothing: reads pages until all are there.
UMBEL_C_API umbel_result umbel_instance_selector_settle(umbel_instance_selector* selector,
                                                        const umbel_lod_view* view,
                                                        const umbel_plane* planes,
                                                        size_t plane_count,
                                                        umbel_instance_step* step);
/// The runs of the last step. *count is their number, also with `runs` NULL.
UMBEL_C_API umbel_result umbel_instance_selector_runs(const umbel_instance_selector* selector,
                                                      umbel_instance_run* runs, size_t capacity,
                                                      size_t* count);
/// Nodes whose pages the last step missed, the most urgent first. *count as above.
UMBEL_C_API umbel_result umbel_instance_selector_missing(const umbel_instance_selector* selector,
                                                         uint32_t* nodes, size_t capacity,
                                                         size_t* count);
/// Reads the pages of nodes. They are shown from the next step on.
UMBEL_C_API umbel_result umbel_instance_selector_load(umbel_instance_selector* selector,
                                                      const uint32_t* nodes, size_t node_count);
/// The instances of a run of the last step. *count as above.
UMBEL_C_API umbel_result umbel_instance_selector_placements(const umbel_instance_selector* selector,
                                                            const umbel_instance_run* run,
                                                            umbel_instance* instances,
                                                            size_t capacity, size_t* count);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_INSTANCE_TREE_H
