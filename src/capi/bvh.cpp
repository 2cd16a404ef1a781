// Hierarchies over triangles from C: how they are made, kept and freed.
#include <algorithm>
#include <cstring>

#include "bvh/tree/check.hpp"
#include "capi/bvh_trees.hpp"
#include "umbel/bvh_presets.hpp"

namespace umbel::capi {
namespace {

bvh::Bvh2 tree_of(const umbel_bvh2* tree) { return copied_tree<bvh::Bvh2>(tree); }

/// Replaces how the config builds; everything else about it stays.
void set_tree(umbel_bvh_config* config, const bvh::Config& tree) {
  TriangleBvhConfig changed = bvh_config(&required(config, "config"));
  changed.tree = tree;
  write_struct(as_c(changed), config, "config");
}

umbel_bvh2_capacity requirements(size_t primitive_count, const bvh::Config& config) {
  if (primitive_count >= kNone)
    throw Error(ErrorCode::kInvalidArgument, "primitive_count is " +
                                                 std::to_string(primitive_count) +
                                                 ", more than 32-bit indices can name");
  umbel_bvh2_capacity result{};
  result.primitives = primitive_count;
  if (config.builder == bvh::Builder::kSpatial)
    result.primitives += static_cast<size_t>(double(primitive_count) *
                                             std::clamp(double(config.spatial_budget), 0.0, 4.0)) +
                         1;
  result.nodes = result.primitives == 0 ? 0 : 2 * result.primitives - 1;
  return result;
}

umbel_bvh2_statistics measure(const umbel_bvh2* tree, const bvh::CostModel& cost) {
  const bvh::Bvh2 copied = tree_of(tree);
  // Whether every primitive is there cannot be known without their number.
  bvh::check_structure(copied, kNone);
  return as_c(bvh::statistics(copied, cost));
}

umbel_bvh_statistics statistics_of(const TriangleBvh& bvh) {
  const TriangleBvhStatistics found = bvh.statistics();
  umbel_bvh_statistics result{};
  result.width = found.width;
  result.nodes = found.nodes;
  result.leaves = found.leaves;
  result.max_depth = found.max_depth;
  result.references = found.references;
  result.triangle_count = bvh.triangle_count();
  result.sah_cost = found.sah_cost;
  result.bytes = found.bytes;
  const Aabb bounds = bvh.bounds();
  std::memcpy(&result.bounds, &bounds, sizeof bounds);
  return result;
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

void umbel_bvh_config_init_sized(umbel_bvh_config* config, size_t size) {
  capi::init_sized(config, size, capi::as_c(TriangleBvhConfig{}));
}

umbel_result umbel_bvh_config_preset(umbel_bvh_config* config, const char* name) {
  return capi::guard([&] { capi::set_tree(config, bvh::preset(&capi::required(name, "name"))); });
}

umbel_result umbel_bvh_config_builder(umbel_bvh_config* config, const char* name) {
  return capi::guard(
      [&] { capi::set_tree(config, bvh::builder_preset(&capi::required(name, "name"))); });
}

umbel_result umbel_bvh_build(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                             const umbel_build_options* options, umbel_bvh** bvh) {
  return capi::hand_out(bvh, "bvh", [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return umbel_bvh{TriangleBvh::build(given.view, capi::bvh_config(config), given.masks,
                                        capi::build_options(options))};
  });
}

umbel_result umbel_bvh_from_bvh2(const umbel_bvh2* tree, const umbel_bvh_mesh* mesh,
                                 const umbel_bvh_config* config, const umbel_build_options* options,
                                 umbel_bvh** bvh) {
  return capi::hand_out(bvh, "bvh", [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return umbel_bvh{TriangleBvh::widen(capi::tree_of(tree), given.view, capi::bvh_config(config),
                                        given.masks, capi::build_options(options))};
  });
}

void umbel_bvh_free(umbel_bvh* bvh) { delete bvh; }

umbel_result umbel_bvh_refit(umbel_bvh* bvh, const umbel_bvh_mesh* mesh,
                             const umbel_build_options* options, umbel_refit_report* report) {
  return capi::guard([&] {
    TriangleBvh& target = capi::required(bvh, "bvh").bvh;
    if (report) capi::read_struct(report, "report");
    const RefitReport found = target.refit(capi::bvh_mesh(mesh).view, capi::build_options(options));
    if (!report) return;
    umbel_refit_report result{};
    result.rebuild_advised = found.rebuild_advised;
    result.sah_cost = found.sah_cost;
    result.built_sah_cost = found.built_sah_cost;
    capi::write_struct(result, report, "report");
  });
}

umbel_result umbel_bvh_save(const umbel_bvh* bvh, const char* path) {
  return capi::guard([&] { capi::required(bvh, "bvh").bvh.save(&capi::required(path, "path")); });
}

umbel_result umbel_bvh_load(const char* path, umbel_bvh** bvh) {
  return capi::hand_out(
      bvh, "bvh", [&] { return umbel_bvh{TriangleBvh::load(&capi::required(path, "path"))}; });
}

umbel_result umbel_bvh_get_statistics(const umbel_bvh* bvh, umbel_bvh_statistics* statistics) {
  return capi::guard([&] {
    capi::write_struct(capi::statistics_of(capi::required(bvh, "bvh").bvh), statistics,
                       "statistics");
  });
}

umbel_result umbel_bvh2_requirements(size_t primitive_count, const umbel_bvh_config* config,
                                     umbel_bvh2_capacity* capacity) {
  return capi::guard([&] {
    capi::write_struct(capi::requirements(primitive_count, capi::bvh_config(config).tree), capacity,
                       "capacity");
  });
}

umbel_result umbel_bvh2_build(const umbel_aabb* boxes, size_t box_count,
                              const umbel_bvh_config* config, const umbel_build_options* options,
                              umbel_bvh2* tree) {
  return capi::build_tree<bvh::Node>(
      config, options, tree, [&](const bvh::Config& how, const BuildOptions& build_options) {
        return bvh::build(capi::elements<const Aabb>(boxes, box_count, "boxes"), how,
                          build_options);
      });
}

umbel_result umbel_bvh2_build_triangles(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                                        const umbel_build_options* options, umbel_bvh2* tree) {
  return capi::build_tree<bvh::Node>(
      config, options, tree, [&](const bvh::Config& how, const BuildOptions& build_options) {
        return bvh::build(capi::bvh_mesh(mesh).view, how, build_options);
      });
}

umbel_result umbel_bvh2_get_statistics(const umbel_bvh2* tree, const umbel_bvh_config* config,
                                       umbel_bvh2_statistics* statistics) {
  return capi::guard([&] {
    capi::write_struct(capi::measure(tree, capi::bvh_config(config).tree.cost), statistics,
                       "statistics");
  });
}
