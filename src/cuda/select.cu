// The functions of umbel/cuda_select.hpp: selection by lod/select on an executor.

#include <algorithm>
#include <string>
#include <vector>

#include "cuda/run.hpp"
#include "lod/select/select_queue.hpp"
#include "umbel/cuda_select.hpp"
#include "umbel/lod/verify.hpp"

namespace umbel::cuda {

uint32_t hierarchy_layers(const lod::Tables& tables) {
  uint32_t layers = 0;
  std::vector<uint32_t> layer, next;
  if (!tables.nodes.empty()) layer.push_back(0);
  for (; !layer.empty(); ++layers) {
    next.clear();
    for (const uint32_t n : layer) {
      const Range& children = tables.nodes[n].children;
      for (uint32_t i = 0; i < children.count; ++i) next.push_back(children.offset + i);
    }
    std::swap(layer, next);
  }
  return layers;
}

void check_device_tables(const lod::Tables& tables) {
  lod::validate(tables);
  for (size_t g = 1; g < tables.groups.size(); ++g)
    if (tables.groups[g].clusters.offset < tables.groups[g - 1].clusters.offset)
      throw Error(ErrorCode::kInvalidArgument,
                  "on a device, groups must be in the order of their clusters, but group " +
                      std::to_string(g) + " begins before the one before it");
}

void mark_resident_groups(void* scratch, size_t& scratch_bytes, const DeviceTables& tables,
                          const Range* levels, uint32_t level_count, const DevicePages& pages,
                          Stream stream) {
  run(scratch, scratch_bytes, stream, tables.groups,
      [&](auto& exec) { mark_groups(exec, tables, levels, level_count, pages); });
}

void select_instances(void* scratch, size_t& scratch_bytes, const DeviceTables& tables,
                      const DeviceScene& scene, const DevicePages& pages, const SelectionRoom& room,
                      const DeviceSelection& out, const DeviceFeedback& feedback, Stream stream) {
  if (uint64_t{scene.instance_count} * tables.group_count >= kNone)
    throw Error(ErrorCode::kUnsupported,
                std::to_string(scene.instance_count) + " instances of a mesh of " +
                    std::to_string(tables.group_count) +
                    " groups are too many for one selection: together at most 2^32 - 2");
  run(scratch, scratch_bytes, stream, tables.groups,
      [&](auto& exec) { select_by_queue(exec, tables, scene, pages, room, out, feedback); });
}

namespace {

/// The view is part of the work: nothing is copied from the host later.
struct PutView {
  lod::View view;
  lod::View* to;
  UMBEL_HOST_DEVICE void operator()(size_t) const { *to = view; }
};

}  // namespace

void put_view(const lod::View& view, lod::View* to, Stream stream) {
  run_alone(stream, to, [&](auto& exec) { exec.for_each(1, PutView{view, to}); });
}

}  // namespace umbel::cuda
