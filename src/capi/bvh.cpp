// Bounding volume hierarchies from C (umbel_bvh.h): hierarchies over triangles, and binary and
// k-ary trees in arrays of the caller.
#include <algorithm>
#include <cstddef>
#include <cstring>

#include "bvh/tree/check.hpp"
#include "capi/bvh_input.hpp"
#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/queries.hpp"
#include "capi/structs.hpp"
#include "umbel/bvh_presets.hpp"

namespace umbel::capi {
namespace {

static_assert(offsetof(umbel_kary_node, children) == offsetof(bvh::KaryNode, children));
static_assert(offsetof(umbel_kary_node, count) == offsetof(bvh::KaryNode, count));

/// The tree that a C caller holds; copied, since the library takes vectors.
template <typename Tree, typename Given>
Tree copied_tree(const Given* tree) {
  using Node = typename decltype(Tree::nodes)::value_type;
  const Given given = read_struct(tree, "tree");
  const auto nodes = elements<const Node>(given.nodes, given.node_count, "tree->nodes");
  const auto primitives =
      elements<const uint32_t>(given.primitives, given.primitive_count, "tree->primitives");
  Tree result;
  result.nodes.assign(nodes.begin(), nodes.end());
  result.primitives.assign(primitives.begin(), primitives.end());
  return result;
}

/// Runs make(config, options) and writes the tree that it gives, or what room it needs.
template <typename Node, typename Given, typename Make>
umbel_result build_tree(const umbel_bvh_config* config, const umbel_build_options* options,
                        Given* tree, const Make& make) {
  return guard([&] {
    Given given = read_struct(tree, "tree");
    given.node_count = given.primitive_count = 0;
    write_struct(given, tree, "tree");
    const auto nodes = elements<Node>(given.nodes, given.node_capacity, "tree->nodes");
    elements<uint32_t>(given.primitives, given.primitive_capacity, "tree->primitives");
    const auto made = make(bvh_config(config).tree, build_options(options));
    given.node_count = made.nodes.size();
    given.primitive_count = made.primitives.size();
    const bool fits = made.nodes.size() <= given.node_capacity &&
                      made.primitives.size() <= given.primitive_capacity;
    if (fits) {
      std::copy(made.nodes.begin(), made.nodes.end(), nodes.begin());
      std::copy(made.primitives.begin(), made.primitives.end(), given.primitives);
    }
    write_struct(given, tree, "tree");
    if (!fits)
      throw CapacityError{"tree has room for " + std::to_string(given.node_capacity) +
                          " nodes and " + std::to_string(given.primitive_capacity) +
                          " primitives, but needs " + std::to_string(made.nodes.size()) + " and " +
                          std::to_string(made.primitives.size())};
  });
}

umbel_bvh2_statistics tree_statistics(const bvh::Statistics& found) {
  umbel_bvh2_statistics result{};
  result.nodes = found.nodes;
  result.leaves = found.leaves;
  result.max_depth = found.max_depth;
  result.references = found.references;
  result.sah_cost = found.sah_cost;
  return result;
}

bvh::Bvh2 tree_of(const umbel_bvh2* tree) { return copied_tree<bvh::Bvh2>(tree); }

/// Replaces how the config builds; everything else about it stays.
void set_tree(umbel_bvh_config* config, const bvh::Config& tree) {
  BvhConfig changed = bvh_config(&required(config, "config"));
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
  return tree_statistics(bvh::statistics(copied, cost));
}

umbel_bvh_statistics statistics_of(const Bvh& bvh) {
  const BvhStatistics found = bvh.statistics();
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

bvh::KaryTree tree_of(const umbel_kary* tree) { return copied_tree<bvh::KaryTree>(tree); }

Queried queried(const umbel_bvh* bvh) { return {bvh ? &bvh->bvh : nullptr, "bvh"}; }

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

void umbel_bvh_config_init_sized(umbel_bvh_config* config, size_t size) {
  capi::init_sized(config, size, capi::as_c(BvhConfig{}));
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
    return umbel_bvh{Bvh::build(given.view, capi::bvh_config(config), given.masks,
                                capi::build_options(options))};
  });
}

umbel_result umbel_bvh_from_bvh2(const umbel_bvh2* tree, const umbel_bvh_mesh* mesh,
                                 const umbel_bvh_config* config, const umbel_build_options* options,
                                 umbel_bvh** bvh) {
  return capi::hand_out(bvh, "bvh", [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return umbel_bvh{Bvh::widen(capi::tree_of(tree), given.view, capi::bvh_config(config),
                                given.masks, capi::build_options(options))};
  });
}

void umbel_bvh_free(umbel_bvh* bvh) { delete bvh; }

umbel_result umbel_bvh_refit(umbel_bvh* bvh, const umbel_bvh_mesh* mesh,
                             const umbel_build_options* options, umbel_refit_report* report) {
  return capi::guard([&] {
    Bvh& target = capi::required(bvh, "bvh").bvh;
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
  return capi::hand_out(bvh, "bvh",
                        [&] { return umbel_bvh{Bvh::load(&capi::required(path, "path"))}; });
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

umbel_result umbel_kary_build(const umbel_aabb* boxes, size_t box_count,
                              const umbel_bvh_config* config, const umbel_build_options* options,
                              umbel_kary* tree) {
  return capi::build_tree<bvh::KaryNode>(
      config, options, tree, [&](const bvh::Config& how, const BuildOptions& build_options) {
        return bvh::build_kmeans_kary(capi::elements<const Aabb>(boxes, box_count, "boxes"), how,
                                      build_options);
      });
}

umbel_result umbel_kary_build_triangles(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                                        const umbel_build_options* options, umbel_kary* tree) {
  return capi::build_tree<bvh::KaryNode>(
      config, options, tree, [&](const bvh::Config& how, const BuildOptions& build_options) {
        return bvh::build_kmeans_kary(capi::bvh_mesh(mesh).view, how, build_options);
      });
}

umbel_result umbel_kary_get_statistics(const umbel_kary* tree, const umbel_bvh_config* config,
                                       umbel_bvh2_statistics* statistics) {
  return capi::guard([&] {
    const bvh::KaryTree copied = capi::tree_of(tree);
    // Whether every primitive is there cannot be known without their number.
    bvh::check(copied, kNone);
    capi::write_struct(capi::tree_statistics(bvh::statistics(copied, capi::bvh_config(config).tree.cost)),
                       statistics, "statistics");
  });
}

umbel_result umbel_bvh_from_kary(const umbel_kary* tree, const umbel_bvh_mesh* mesh,
                                 const umbel_bvh_config* config, const umbel_build_options* options,
                                 umbel_bvh** bvh) {
  return capi::hand_out(bvh, "bvh", [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return umbel_bvh{Bvh::widen(capi::tree_of(tree), given.view, capi::bvh_config(config),
                                given.masks, capi::build_options(options))};
  });
}

// ---- queries -----------------------------------------------------------------------------------

umbel_result umbel_bvh_intersect(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                 const umbel_ray_options* options, umbel_hit* hits) {
  return capi::intersect(capi::queried(bvh), rays, count, options, hits);
}

umbel_result umbel_bvh_occluded(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                const umbel_ray_options* options, uint8_t* results) {
  return capi::occluded(capi::queried(bvh), rays, count, options, results);
}

umbel_result umbel_bvh_all_hits(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                const umbel_ray_options* options, size_t hits_per_ray,
                                umbel_hit* hits, uint32_t* hit_counts) {
  return capi::all_hits(capi::queried(bvh), rays, count, options, hits_per_ray, hits, hit_counts);
}

umbel_result umbel_bvh_closest_point(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                     float max_distance, uint32_t threads,
                                     umbel_closest_point* results) {
  return capi::closest_point(capi::queried(bvh), points, count, max_distance, threads, results);
}

umbel_result umbel_bvh_contains(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                uint32_t threads, uint8_t* results) {
  return capi::contains(capi::queried(bvh), points, count, threads, results);
}

umbel_result umbel_bvh_signed_distance(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                       uint32_t threads, float* results) {
  return capi::signed_distance(capi::queried(bvh), points, count, threads, results);
}

umbel_result umbel_bvh_overlaps_box(const umbel_bvh* bvh, const umbel_aabb* box,
                                    uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(bvh), box, triangles, capacity, count);
}

umbel_result umbel_bvh_overlaps_sphere(const umbel_bvh* bvh, const umbel_sphere* sphere,
                                       uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(bvh), sphere, triangles, capacity, count);
}

umbel_result umbel_bvh_overlaps_frustum(const umbel_bvh* bvh, const umbel_plane* planes,
                                        uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(bvh), planes, triangles, capacity, count);
}
