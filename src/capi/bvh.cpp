// Bounding volume hierarchies from C (umbel_bvh.h): hierarchies over triangles, and binary and
// k-ary trees in arrays of the caller.
#include <algorithm>
#include <cstddef>
#include <cstring>

#include "base/fields.hpp"
#include "bvh/tree/check.hpp"
#include "bvh/tree/config.hpp"
#include "capi/bvh2_output.hpp"
#include "capi/bvh_input.hpp"
#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/queries.hpp"
#include "capi/structs.hpp"
#include "umbel/bvh_presets.hpp"
#include "umbel/collision.hpp"

namespace umbel::capi {
namespace {

static_assert(offsetof(umbel_kary_node, children) == offsetof(bvh::KaryNode, children));
static_assert(offsetof(umbel_kary_node, count) == offsetof(bvh::KaryNode, count));

/// The caller's observer, as bvh::build takes it.
bvh::StageObserver stage_observer(const umbel_build_options* options) {
  if (!options) return {};
  const umbel_build_options given = read_struct(options, "options");
  if (!given.stage_observer) return {};
  return [given](std::string_view stage, double seconds) {
    given.stage_observer(std::string(stage).c_str(), seconds, given.stage_user);
  };
}

/// Binary trees, and the k-ary ones of k-means, in arrays of a C caller.
struct Binary {
  using Given = umbel_bvh2;
  using Tree = bvh::Bvh2;
  using Node = bvh::Node;
  template <typename Source>
  static Tree build(const Source& source, const bvh::Config& config,
                    const umbel_build_options* options) {
    return bvh::build(source, config, build_options(options), stage_observer(options));
  }
  static void check(const Tree& tree) { bvh::check_structure(tree, kNone); }
};

struct Kary {
  using Given = umbel_kary;
  using Tree = bvh::KaryTree;
  using Node = bvh::KaryNode;
  template <typename Source>
  static Tree build(const Source& source, const bvh::Config& config,
                    const umbel_build_options* options) {
    return bvh::build_kmeans_kary(source, config, build_options(options));
  }
  static void check(const Tree& tree) { bvh::check(tree, kNone); }
};

/// The tree that a C caller holds; copied, since the library takes vectors.
template <typename Kind>
typename Kind::Tree copied_tree(const typename Kind::Given* tree) {
  using Node = typename Kind::Node;
  using Given = typename Kind::Given;
  const Given given = read_struct(tree, "tree");
  check_nameable(given.node_count, "tree->node_count");
  check_nameable(given.primitive_count, "tree->primitive_count");
  const auto nodes = elements<const Node>(given.nodes, given.node_count, "tree->nodes");
  const auto primitives =
      elements<const uint32_t>(given.primitives, given.primitive_count, "tree->primitives");
  typename Kind::Tree result;
  result.nodes.assign(nodes.begin(), nodes.end());
  result.primitives.assign(primitives.begin(), primitives.end());
  return result;
}

/// Builds over what source() gives, and writes the tree or the room that it needs.
template <typename Kind, typename Source>
umbel_result build_tree(const umbel_bvh_config* config, const umbel_build_options* options,
                        typename Kind::Given* tree, const Source& source) {
  return hand_out_tree<typename Kind::Node>(
      tree, "tree", [&] { return Kind::build(source(), bvh_config(config).tree, options); });
}

umbel_bvh2_statistics tree_statistics(const bvh::Statistics& found) {
  umbel_bvh2_statistics result{};
  COPY_FIELDS(result, found, nodes, leaves, max_depth, references, sah_cost);
  return result;
}

/// Replaces how the config builds; everything else about it stays.
void set_tree(umbel_bvh_config* config, const bvh::Config& tree) {
  BvhConfig changed = bvh_config(&required(config, "config"));
  changed.tree = tree;
  write_struct(as_c(changed), config, "config");
}

umbel_bvh2_capacity requirements(size_t primitive_count, const bvh::Config& config) {
  check_nameable(primitive_count, "primitive_count");
  bvh::check_config(config, primitive_count);
  umbel_bvh2_capacity result{};
  result.primitives = primitive_count;
  if (config.builder == bvh::Builder::kSpatial)
    result.primitives +=
        static_cast<size_t>(double(primitive_count) * double(config.spatial_budget)) + 1;
  result.nodes = result.primitives == 0 ? 0 : 2 * result.primitives - 1;
  return result;
}

/// Checks and measures a tree. Without the number of primitives it cannot be known whether all are
/// there.
template <typename Kind>
umbel_result get_tree_statistics(const typename Kind::Given* tree, const umbel_bvh_config* config,
                                 umbel_bvh2_statistics* statistics) {
  return guard([&] {
    const bvh::CostModel cost = bvh_config(config).tree.cost;
    bvh::check_cost(cost);
    const typename Kind::Tree copied = copied_tree<Kind>(tree);
    Kind::check(copied);
    write_struct(tree_statistics(bvh::statistics(copied, cost)), statistics, "statistics");
  });
}

template <typename Kind>
umbel_result widen(const typename Kind::Given* tree, const umbel_bvh_mesh* mesh,
                   const umbel_bvh_config* config, const umbel_build_options* options,
                   umbel_bvh** bvh) {
  return hand_out(bvh, "bvh", [&] {
    const BvhMesh given = bvh_mesh(mesh);
    return umbel_bvh{Bvh::widen(copied_tree<Kind>(tree), given.view, bvh_config(config),
                                given.masks, build_options(options))};
  });
}

umbel_bvh_statistics statistics_of(const Bvh& bvh) {
  const BvhStatistics found = bvh.statistics();
  umbel_bvh_statistics result{};
  COPY_FIELDS(result, found, width, nodes, leaves, max_depth, references);
  result.triangle_count = bvh.triangle_count();
  result.sah_cost = found.sah_cost;
  result.bytes = found.bytes;
  const Aabb bounds = bvh.bounds();
  std::memcpy(&result.bounds, &bounds, sizeof bounds);
  return result;
}

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
  return capi::widen<capi::Binary>(tree, mesh, config, options, bvh);
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
  return capi::build_tree<capi::Binary>(
      config, options, tree, [&] { return capi::elements<const Aabb>(boxes, box_count, "boxes"); });
}

umbel_result umbel_bvh2_build_triangles(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                                        const umbel_build_options* options, umbel_bvh2* tree) {
  capi::BvhMesh given;  // what is built over may be a copy
  return capi::build_tree<capi::Binary>(config, options, tree, [&] {
    given = capi::bvh_mesh(mesh);
    return given.view;
  });
}

umbel_result umbel_bvh2_get_statistics(const umbel_bvh2* tree, const umbel_bvh_config* config,
                                       umbel_bvh2_statistics* statistics) {
  return capi::get_tree_statistics<capi::Binary>(tree, config, statistics);
}

umbel_result umbel_kary_build(const umbel_aabb* boxes, size_t box_count,
                              const umbel_bvh_config* config, const umbel_build_options* options,
                              umbel_kary* tree) {
  return capi::build_tree<capi::Kary>(
      config, options, tree, [&] { return capi::elements<const Aabb>(boxes, box_count, "boxes"); });
}

umbel_result umbel_kary_build_triangles(const umbel_bvh_mesh* mesh, const umbel_bvh_config* config,
                                        const umbel_build_options* options, umbel_kary* tree) {
  capi::BvhMesh given;  // what is built over may be a copy
  return capi::build_tree<capi::Kary>(config, options, tree, [&] {
    given = capi::bvh_mesh(mesh);
    return given.view;
  });
}

umbel_result umbel_kary_get_statistics(const umbel_kary* tree, const umbel_bvh_config* config,
                                       umbel_bvh2_statistics* statistics) {
  return capi::get_tree_statistics<capi::Kary>(tree, config, statistics);
}

umbel_result umbel_bvh_from_kary(const umbel_kary* tree, const umbel_bvh_mesh* mesh,
                                 const umbel_bvh_config* config, const umbel_build_options* options,
                                 umbel_bvh** bvh) {
  return capi::widen<capi::Kary>(tree, mesh, config, options, bvh);
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

// ---- collision detection -----------------------------------------------------------------------

namespace {

CollisionOptions collision_options(const double* second_to_first, uint32_t threads) {
  CollisionOptions options;
  if (second_to_first) std::copy_n(second_to_first, 12, options.second_to_first.begin());
  options.threads = threads;
  return options;
}

}  // namespace

umbel_result umbel_bvh_collide(const umbel_bvh* first, const umbel_bvh* second,
                               const double* second_to_first, uint32_t threads,
                               umbel_triangle_pair* pairs, size_t capacity, size_t* count) {
  static_assert(sizeof(umbel_triangle_pair) == sizeof(TrianglePair));
  if (count) *count = 0;
  return capi::guard([&] {
    capi::required(count, "count");
    const auto found =
        collide(capi::required(first, "first").bvh, capi::required(second, "second").bvh,
                collision_options(second_to_first, threads));
    capi::hand_out_all(found, reinterpret_cast<TrianglePair*>(pairs), "pairs", capacity, count);
  });
}

umbel_result umbel_bvh_collides(const umbel_bvh* first, const umbel_bvh* second,
                                const double* second_to_first, uint32_t threads, uint8_t* result) {
  return capi::guard([&] {
    uint8_t& answer = capi::required(result, "result");
    answer = collides(capi::required(first, "first").bvh, capi::required(second, "second").bvh,
                      collision_options(second_to_first, threads))
                 ? 1
                 : 0;
  });
}
