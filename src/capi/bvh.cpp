// Hierarchies over triangles from C: how they are made, kept and freed.
#include <algorithm>
#include <cstring>
#include <memory>

#include "bvh/check.hpp"
#include "capi/bvh_input.hpp"
#include "capi/cluster_input.hpp"
#include "capi/guard.hpp"
#include "capi/structs.hpp"
#include "umbel/bvh_presets.hpp"

namespace umbel::capi {
namespace {

/// Runs make() and hands the caller what it made; NULL if it throws.
template <typename Make>
umbel_result hand_out(umbel_bvh** bvh, const Make& make) {
  if (bvh) *bvh = nullptr;
  return guard([&] {
    umbel_bvh*& result = required(bvh, "bvh");
    result = new umbel_bvh{make()};
  });
}

/// The binary tree that a C caller holds; copied, since the library takes vectors.
bvh::Bvh2 tree_of(const umbel_bvh2* tree) {
  const umbel_bvh2 given = read_struct(tree, "tree");
  const auto nodes = elements<const bvh::Node>(given.nodes, given.node_count, "tree->nodes");
  const auto primitives =
      elements<const uint32_t>(given.primitives, given.primitive_count, "tree->primitives");
  bvh::Bvh2 result;
  result.nodes.assign(nodes.begin(), nodes.end());
  result.primitives.assign(primitives.begin(), primitives.end());
  return result;
}

/// Replaces how the config builds; everything else about it stays.
void set_tree(umbel_bvh_config* config, const bvh::Config& tree) {
  TriangleBvhConfig changed = bvh_config(&required(config, "config"));
  changed.tree = tree;
  write_struct(as_c(changed), config, "config");
}

/// The room that the caller's arrays have, and what a tree needs of it.
void write_tree(const bvh::Bvh2& made, const umbel_bvh2& given, umbel_bvh2* tree) {
  umbel_bvh2 result = given;
  result.node_count = made.nodes.size();
  result.primitive_count = made.primitives.size();
  const bool fits = made.nodes.size() <= given.node_capacity &&
                    made.primitives.size() <= given.primitive_capacity;
  if (fits) {
    std::copy(made.nodes.begin(), made.nodes.end(), reinterpret_cast<bvh::Node*>(given.nodes));
    std::copy(made.primitives.begin(), made.primitives.end(), given.primitives);
  }
  write_struct(result, tree, "tree");
  if (!fits)
    throw CapacityError{"tree has room for " + std::to_string(given.node_capacity) + " nodes and " +
                        std::to_string(given.primitive_capacity) + " primitives, but needs " +
                        std::to_string(made.nodes.size()) + " and " +
                        std::to_string(made.primitives.size())};
}

/// Runs make(config, options) and writes the tree that it gives.
template <typename Make>
umbel_result build_tree(const umbel_bvh_config* config, const umbel_build_options* options,
                        umbel_bvh2* tree, const Make& make) {
  return guard([&] {
    umbel_bvh2 given = read_struct(tree, "tree");
    given.node_count = given.primitive_count = 0;
    write_struct(given, tree, "tree");
    elements<bvh::Node>(given.nodes, given.node_capacity, "tree->nodes");
    elements<uint32_t>(given.primitives, given.primitive_capacity, "tree->primitives");
    write_tree(make(bvh_config(config).tree, build_options(options)), given, tree);
  });
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
  const bvh::Statistics found = bvh::statistics(copied, cost);
  umbel_bvh2_statistics result{};
  result.nodes = found.nodes;
  result.leaves = found.leaves;
  result.max_depth = found.max_depth;
  result.references = found.references;
  result.sah_cost = found.sah_cost;
  return result;
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
  return capi::hand_out(bvh, [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return TriangleBvh::build(given.view, capi::bvh_config(config), given.masks,
                              capi::build_options(options));
  });
}

umbel_result umbel_bvh_from_bvh2(const umbel_bvh2* tree, const umbel_bvh_mesh* mesh,
                                 const umbel_bvh_config* config, const umbel_build_options* options,
                                 umbel_bvh** bvh) {
  return capi::hand_out(bvh, [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return TriangleBvh::widen(capi::tree_of(tree), given.view, capi::bvh_config(config),
                              given.masks, capi::build_options(options));
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
  return capi::hand_out(bvh, [&] { return TriangleBvh::load(&capi::required(path, "path")); });
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
  return capi::build_tree(config, options, tree,
                          [&](const bvh::Config& how, const BuildOptions& build_options) {
                            return bvh::build(capi::elements<const Aabb>(boxes, box_count, "boxes"),
                                              how, build_options);
                          });
}

umbel_result umbel_bvh2_build_triangles(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                                        const umbel_build_options* options, umbel_bvh2* tree) {
  return capi::build_tree(config, options, tree,
                          [&](const bvh::Config& how, const BuildOptions& build_options) {
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
