// Trees of instances from C (umbel_instance_tree.h).
#include "umbel/instance_tree.hpp"

#include <bit>
#include <vector>

#include "base/fields.hpp"
#include "capi/asset_handle.hpp"
#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/lod_input.hpp"
#include "capi/structs.hpp"
#include "umbel/umbel_instance_tree.h"

struct umbel_instance_selector {
  const umbel::Asset& asset;
  umbel::InstanceSelector selector;
  umbel::InstanceStep last{};
};

namespace umbel::capi {
namespace {

static_assert(sizeof(umbel_instance) == sizeof(Instance));

std::vector<umbel_instance> instances_as_c(std::span<const Instance> instances) {
  std::vector<umbel_instance> all;
  all.reserve(instances.size());
  for (const Instance& instance : instances) all.push_back(std::bit_cast<umbel_instance>(instance));
  return all;
}

umbel_result take_step(umbel_instance_selector* selector, const umbel_lod_view* view,
                       const umbel_plane* planes, size_t plane_count, umbel_instance_step* step,
                       InstanceStep (InstanceSelector::*make)(const lod::View&,
                                                              std::span<const Plane>)) {
  return guard([&] {
    umbel_instance_selector& s = required(selector, "selector");
    struct_size_of(step, "step", sizeof(umbel_instance_step));
    const auto all = elements<const Plane>(planes, plane_count, "planes");
    s.last = (s.selector.*make)(view_of(view), all);
    umbel_instance_step out{};
    out.run_count = s.last.runs.size();
    out.missing_count = s.last.missing.size();
    COPY_FIELDS(out, s.last, shown, refined, stand_ins);
    write_struct(out, step, "step");
  });
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;
using namespace umbel::capi;

umbel_result umbel_asset_get_instances(const umbel_asset* asset, umbel_instance* instances,
                                       size_t capacity, size_t* count) {
  return guard([&] {
    hand_out_all(instances_as_c(required(asset, "asset").asset.instances()), instances, "instances",
                 capacity, count);
  });
}

int umbel_asset_has_instance_tree(const umbel_asset* asset) {
  return asset && asset->asset.has_instance_tree() ? 1 : 0;
}

umbel_result umbel_instance_selector_create(const umbel_asset* asset, size_t max_bytes,
                                            umbel_instance_selector** selector) {
  return hand_out(selector, "selector", [&] {
    const Asset& a = required(asset, "asset").asset;
    return umbel_instance_selector{a, InstanceSelector(a, limit(max_bytes))};
  });
}

void umbel_instance_selector_free(umbel_instance_selector* selector) { delete selector; }

uint64_t umbel_instance_selector_instances(const umbel_instance_selector* selector) {
  return selector ? selector->asset.instance_nodes().front().instances : 0;
}

umbel_result umbel_instance_selector_step(umbel_instance_selector* selector,
                                          const umbel_lod_view* view, const umbel_plane* planes,
                                          size_t plane_count, umbel_instance_step* step) {
  return take_step(selector, view, planes, plane_count, step, &InstanceSelector::step);
}

umbel_result umbel_instance_selector_settle(umbel_instance_selector* selector,
                                            const umbel_lod_view* view, const umbel_plane* planes,
                                            size_t plane_count, umbel_instance_step* step) {
  return take_step(selector, view, planes, plane_count, step, &InstanceSelector::settle);
}

umbel_result umbel_instance_selector_runs(const umbel_instance_selector* selector,
                                          umbel_instance_run* runs, size_t capacity,
                                          size_t* count) {
  return guard([&] {
    std::vector<umbel_instance_run> all;
    for (const InstanceRun& run : required(selector, "selector").last.runs)
      all.push_back({run.node, {run.placements.offset, run.placements.count}, run.is_coarsest});
    hand_out_all(all, runs, "runs", capacity, count);
  });
}

umbel_result umbel_instance_selector_missing(const umbel_instance_selector* selector,
                                             uint32_t* nodes, size_t capacity, size_t* count) {
  return guard([&] {
    hand_out_all(required(selector, "selector").last.missing, nodes, "nodes", capacity, count);
  });
}

umbel_result umbel_instance_selector_load(umbel_instance_selector* selector, const uint32_t* nodes,
                                          size_t node_count) {
  return guard([&] {
    required(selector, "selector")
        .selector.load(elements<const uint32_t>(nodes, node_count, "nodes"));
  });
}

umbel_result umbel_instance_selector_placements(const umbel_instance_selector* selector,
                                                const umbel_instance_run* run,
                                                umbel_instance* instances, size_t capacity,
                                                size_t* count) {
  return guard([&] {
    const umbel_instance_run& r = required(run, "run");
    const auto found =
        required(selector, "selector")
            .selector.placements(
                {r.node, {r.placements.offset, r.placements.count}, r.is_coarsest != 0});
    hand_out_all(instances_as_c(found), instances, "instances", capacity, count);
  });
}
