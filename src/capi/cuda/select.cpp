// umbel_cuda_select.h over cuda_select.hpp. Part of the library umbel::cuda.
#include "capi/guard.hpp"
#include "capi/lod_input.hpp"
#include "umbel/cuda_select.hpp"
#include "umbel/umbel_cuda_select.h"

namespace umbel::capi {
namespace {

static_assert(sizeof(umbel_lod_view) == sizeof(lod::View));
static_assert(sizeof(umbel_lod_node) == sizeof(lod::Node));
static_assert(sizeof(umbel_lod_group) == sizeof(lod::Group));
static_assert(sizeof(umbel_lod_cluster) == sizeof(lod::Cluster));
static_assert(sizeof(umbel_transform) == sizeof(Transform));
static_assert(sizeof(umbel_cuda_counts) == sizeof(cuda::SelectionCounts));

template <typename T, typename From>
const T* same(const From* pointer) {
  return reinterpret_cast<const T*>(pointer);
}

cuda::DeviceTables tables_of(const umbel_cuda_tables* given) {
  const umbel_cuda_tables& t = required(given, "tables");
  return {same<lod::Node>(t.nodes),
          same<lod::Group>(t.groups),
          same<lod::Cluster>(t.clusters),
          same<ClusterBounds>(t.normal_cones),
          t.group_count,
          t.layers};
}

cuda::DeviceScene scene_of(const umbel_cuda_scene* given) {
  const umbel_cuda_scene& s = required(given, "scene");
  return {same<lod::View>(s.view), same<Plane>(s.planes), s.plane_count,
          same<Transform>(s.instances), s.instance_count};
}

cuda::DevicePages pages_of(const umbel_cuda_pages& p) {
  return {p.page_of_group, p.resident, p.states, p.page_count};
}

/// Only looked at when there is work to do.
cuda::DeviceSelection selection_of(const umbel_cuda_selection* given, const void* scratch) {
  if (!given && !scratch) return {};
  const umbel_cuda_selection& s = required(given, "out");
  return {s.offsets, s.clusters, reinterpret_cast<cuda::SelectionCounts*>(s.counts)};
}

}  // namespace
}  // namespace umbel::capi

using umbel::capi::guard;
using umbel::capi::required;

umbel_result umbel_cuda_check_tables(const umbel_lod_arrays* arrays, uint32_t* layers) {
  umbel_lod_tables* tables = nullptr;
  const umbel_result result = umbel_lod_tables_create(arrays, &tables);
  if (result != UMBEL_OK) return result;
  const std::unique_ptr<umbel_lod_tables> owner(tables);
  return guard([&] {
    umbel::cuda::check_device_tables(tables->tables);
    required(layers, "layers") = umbel::cuda::hierarchy_layers(tables->tables);
  });
}

umbel_result umbel_cuda_mark_resident_groups(void* scratch, size_t* scratch_bytes,
                                             const umbel_cuda_tables* tables,
                                             const umbel_range* levels, uint32_t level_count,
                                             const umbel_cuda_pages* pages, void* stream) {
  return guard([&] {
    umbel::cuda::mark_resident_groups(
        scratch, required(scratch_bytes, "scratch_bytes"), umbel::capi::tables_of(tables),
        umbel::capi::same<umbel::Range>(levels), level_count,
        umbel::capi::pages_of(required(pages, "pages")), static_cast<umbel::cuda::Stream>(stream));
  });
}

umbel_result umbel_cuda_put_view(const umbel_lod_view* view, umbel_lod_view* to, void* stream) {
  return guard([&] {
    umbel::cuda::put_view(*umbel::capi::same<umbel::lod::View>(&required(view, "view")),
                          reinterpret_cast<umbel::lod::View*>(&required(to, "to")),
                          static_cast<umbel::cuda::Stream>(stream));
  });
}

umbel_result umbel_cuda_select(void* scratch, size_t* scratch_bytes,
                               const umbel_cuda_tables* tables, const umbel_cuda_scene* scene,
                               const umbel_cuda_pages* pages, const umbel_cuda_room* room,
                               const umbel_cuda_selection* out, const umbel_cuda_feedback* feedback,
                               void* stream) {
  return guard([&] {
    const umbel_cuda_room& r = required(room, "room");
    umbel::cuda::DeviceFeedback wanted;
    if (feedback) wanted = {feedback->urgencies, feedback->requests};
    umbel::cuda::select_instances(
        scratch, required(scratch_bytes, "scratch_bytes"), umbel::capi::tables_of(tables),
        umbel::capi::scene_of(scene),
        pages ? umbel::capi::pages_of(*pages) : umbel::cuda::DevicePages{},
        {r.queue, r.groups, r.clusters}, umbel::capi::selection_of(out, scratch), wanted,
        static_cast<umbel::cuda::Stream>(stream));
  });
}
