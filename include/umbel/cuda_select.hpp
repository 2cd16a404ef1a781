// Selection on CUDA devices: the cuts of thousands of instances of one mesh, the same clusters in
// the same order as lod::select_instances gives (lod/select.hpp), and what of an asset is missing
// for them. Part of the library umbel::cuda; cuda_types.hpp says what holds of pointers, streams,
// scratch memory and errors.
//
// A traversal descends the hierarchy breadth-first, all instances at once, with a queue of nodes in
// device memory; which groups each instance shows is kept as bits, so that the result does not
// depend on the order in which the queue fills. View, planes, transforms and pages are read on the
// device: a captured graph follows whatever is written there.
#pragma once

#include <cstddef>
#include <cstdint>

#include "umbel/cuda_types.hpp"
#include "umbel/lod/select.hpp"

namespace umbel::cuda {

/// A mesh's lod::Tables in device memory, element by element as they are. Their groups must be in
/// the order of their clusters, as those of every DAG and asset are, and every index valid
/// (lod::validate).
struct DeviceTables {
  const lod::Node* nodes;
  const lod::Group* groups;
  const lod::Cluster* clusters;
  const ClusterBounds* normal_cones =
      nullptr;  ///< as Culling::normal_cones, one a cluster; null: none
  uint32_t group_count = 0;
  uint32_t layers = 0;  ///< hierarchy_layers of the nodes; 0: there are none
};

/// Layers of a hierarchy: 1 if the root is all there is.
UMBEL_API uint32_t hierarchy_layers(const lod::Tables& tables);
/// Throws kInvalidArgument for tables that selection on a device cannot use: those that
/// lod::validate refuses, and groups out of order.
UMBEL_API void check_device_tables(const lod::Tables& tables);

/// What is seen, in device memory.
struct DeviceScene {
  const lod::View* view;               ///< one, of the scene; values as lod::select wants them
  const lod::Plane* planes = nullptr;  ///< of the scene, as Culling::planes
  uint32_t plane_count = 0;
  const Transform* instances = nullptr;
  uint32_t instance_count = 0;
};

/// What of an asset is in memory, in device memory.
struct DevicePages {
  const uint32_t* page_of_group = nullptr;  ///< null: everything is there
  const uint8_t* resident = nullptr;        ///< one a page: 1 where it is in memory
  uint32_t* states = nullptr;               ///< one a group: of mark_resident_groups
  uint32_t page_count = 0;
};

/// Which groups can be shown with the pages that are there: those whose pages are, and so on for
/// all groups made from them. Sets pages.states; to be called when `resident` has changed.
/// `levels` is Tables::levels, in the host's memory, and is copied.
UMBEL_API void mark_resident_groups(void* scratch, size_t& scratch_bytes,
                                    const DeviceTables& tables, const Range* levels,
                                    uint32_t level_count, const DevicePages& pages,
                                    Stream stream = nullptr);

/// Room for a selection. What is too small is said in SelectionCounts, and then no instance has a
/// cut.
struct SelectionRoom {
  uint32_t queue;     ///< inner nodes whose children are visited in a layer, of all instances
  uint32_t groups;    ///< that instances show, of all together
  uint32_t clusters;  ///< of all cuts together
};

enum SelectionOverflow : uint32_t { kQueueFull = 1, kGroupsFull = 2, kClustersFull = 4 };

/// How large a selection was.
struct SelectionCounts {
  uint32_t queue;     ///< the most that a layer wanted of the queue
  uint32_t groups;    ///< that instances show
  uint32_t clusters;  ///< of all cuts, 0xffffffff for more than that
  uint32_t requests;  ///< pages that are missing
  uint32_t refused;   ///< instances without a cut, because their transforms are not finite or not
                      ///< invertible, or put the eye too far away
  uint32_t overflow;  ///< 0, or SelectionOverflow bits: what was too small. Numbers of what comes
                      ///< after a queue that was full are too low.
};

/// The cuts. Instance i shows clusters[offsets[i] .. offsets[i + 1]), ascending.
struct DeviceSelection {
  uint32_t* offsets;   ///< instances + 1
  uint32_t* clusters;  ///< SelectionRoom::clusters
  SelectionCounts* counts;
};

/// What the cuts want of the asset; used with DevicePages.
struct DeviceFeedback {
  /// One a page: by how much the error of what is shown instead of its groups would be too large,
  /// at worst, as Residency counts it (up to 1e6); 0: no instance wants it. Also of pages that are
  /// there, whose time to leave has come where it stays 0.
  float* urgencies = nullptr;
  /// Room for a page each: those that are wanted and missing, ascending.
  uint32_t* requests = nullptr;
};

/// Writes a view into device memory, behind what is in the stream. Nothing waits; a captured graph
/// writes this view again at every replay.
UMBEL_API void put_view(const lod::View& view, lod::View* to, Stream stream = nullptr);

/// Selects. With pages, an instance shows what it can with what is there: a group is refined only
/// if its page is there and all groups made from it are refined, so there is no hole and no overlap
/// whatever is missing. A page is wanted if a group of it must be refined and one of the groups
/// made from it can be. Throws kUnsupported where instances times groups are 2^32 or more.
UMBEL_API void select_instances(void* scratch, size_t& scratch_bytes, const DeviceTables& tables,
                                const DeviceScene& scene, const DevicePages& pages,
                                const SelectionRoom& room, const DeviceSelection& out,
                                const DeviceFeedback& feedback, Stream stream = nullptr);

}  // namespace umbel::cuda
