// Kd-trees from C (umbel_kdtree.h).
#include "umbel/kdtree.hpp"

#include <algorithm>
#include <cstring>

#include "base/fields.hpp"
#include "capi/bvh_input.hpp"
#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/queries.hpp"
#include "capi/structs.hpp"
#include "umbel/umbel_kdtree.h"

/// What a C caller holds.
struct umbel_kdtree {
  umbel::kdtree::KdTree tree;
};

namespace umbel::capi {
namespace {

using kdtree::KdTree;
using kdtree::KdTreeConfig;
using kdtree::Traversal;

static_assert(uint32_t{UMBEL_KDTREE_BINNED} == uint32_t(kdtree::Builder::kBinned));
static_assert(uint32_t{UMBEL_KDTREE_SHORT_STACK} == uint32_t(Traversal::kShortStack));

umbel_kdtree_config config_as_c(const KdTreeConfig& config) {
  umbel_kdtree_config result{};
  result.struct_size = sizeof result;
  result.builder = static_cast<uint32_t>(config.tree.builder);
  result.traversal_cost = config.tree.cost.traversal;
  result.intersection_cost = config.tree.cost.intersection;
  result.empty_bonus = config.tree.empty_bonus;
  result.max_depth = config.tree.max_depth;
  result.bad_refines = config.tree.bad_refines;
  result.max_references = config.tree.max_references;
  result.bins = config.tree.bins;
  result.drop_invalid = config.tree.invalid == bvh::InvalidTriangles::kDrop;
  result.traversal = static_cast<uint32_t>(config.traversal);
  result.compact = config.compact;
  result.simd = static_cast<uint32_t>(config.simd);
  return result;
}

KdTreeConfig kdtree_config(const umbel_kdtree_config* config) {
  if (!config) return {};
  const umbel_kdtree_config given = read_struct(config, "config");
  KdTreeConfig result;
  result.tree.builder = static_cast<kdtree::Builder>(given.builder);
  result.tree.cost = {given.traversal_cost, given.intersection_cost};
  result.tree.empty_bonus = given.empty_bonus;
  result.tree.max_depth = given.max_depth;
  result.tree.bad_refines = given.bad_refines;
  result.tree.max_references = given.max_references;
  result.tree.bins = given.bins;
  result.tree.invalid =
      given.drop_invalid ? bvh::InvalidTriangles::kDrop : bvh::InvalidTriangles::kRefuse;
  result.traversal = static_cast<Traversal>(given.traversal);
  result.compact = given.compact != 0;
  result.simd = simd_of(given.simd);
  return result;
}

umbel_kdtree_statistics statistics_of(const KdTree& tree) {
  const kdtree::Statistics found = tree.statistics();
  umbel_kdtree_statistics result{};
  COPY_FIELDS(result, found, nodes, leaves, empty_leaves, max_depth);
  result.triangle_count = tree.triangle_count();
  COPY_FIELDS(result, found, references, sah_cost, inner_visits, leaf_visits, tests, bytes);
  const Aabb bounds = tree.bounds();
  std::memcpy(&result.bounds, &bounds, sizeof bounds);
  return result;
}

Queried queried(const umbel_kdtree* tree) { return {tree ? &tree->tree : nullptr, "tree"}; }

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

void umbel_kdtree_config_init_sized(umbel_kdtree_config* config, size_t size) {
  capi::init_sized(config, size, capi::config_as_c(kdtree::KdTreeConfig{}));
}

umbel_result umbel_kdtree_build(const umbel_bvh_mesh* mesh, const umbel_kdtree_config* config,
                                const umbel_build_options* options, umbel_kdtree** tree) {
  return capi::hand_out(tree, "tree", [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return umbel_kdtree{kdtree::KdTree::build(given.view, capi::kdtree_config(config), given.masks,
                                              capi::build_options(options))};
  });
}

void umbel_kdtree_free(umbel_kdtree* tree) { delete tree; }

umbel_result umbel_kdtree_set_traversal(umbel_kdtree* tree, uint32_t traversal) {
  return capi::guard([&] {
    capi::required(tree, "tree").tree.set_traversal(static_cast<kdtree::Traversal>(traversal));
  });
}

umbel_result umbel_kdtree_save(const umbel_kdtree* tree, const char* path) {
  return capi::guard(
      [&] { capi::required(tree, "tree").tree.save(&capi::required(path, "path")); });
}

umbel_result umbel_kdtree_load(const char* path, uint32_t traversal, umbel_kdtree** tree) {
  return capi::hand_out(tree, "tree", [&] {
    return umbel_kdtree{kdtree::KdTree::load(&capi::required(path, "path"),
                                             static_cast<kdtree::Traversal>(traversal))};
  });
}

umbel_result umbel_kdtree_get_statistics(const umbel_kdtree* tree,
                                         umbel_kdtree_statistics* statistics) {
  return capi::guard([&] {
    capi::write_struct(capi::statistics_of(capi::required(tree, "tree").tree), statistics,
                       "statistics");
  });
}

// ---- queries -----------------------------------------------------------------------------------

umbel_result umbel_kdtree_intersect(const umbel_kdtree* tree, const umbel_ray* rays, size_t count,
                                    const umbel_ray_options* options, umbel_hit* hits) {
  return capi::intersect(capi::queried(tree), rays, count, options, hits);
}

umbel_result umbel_kdtree_occluded(const umbel_kdtree* tree, const umbel_ray* rays, size_t count,
                                   const umbel_ray_options* options, uint8_t* results) {
  return capi::occluded(capi::queried(tree), rays, count, options, results);
}

umbel_result umbel_kdtree_all_hits(const umbel_kdtree* tree, const umbel_ray* rays, size_t count,
                                   const umbel_ray_options* options, size_t hits_per_ray,
                                   umbel_hit* hits, uint32_t* hit_counts) {
  return capi::all_hits(capi::queried(tree), rays, count, options, hits_per_ray, hits, hit_counts);
}

umbel_result umbel_kdtree_closest_point(const umbel_kdtree* tree, const umbel_vec3* points,
                                        size_t count, float max_distance, uint32_t threads,
                                        umbel_closest_point* results) {
  return capi::closest_point(capi::queried(tree), points, count, max_distance, threads, results);
}

umbel_result umbel_kdtree_contains(const umbel_kdtree* tree, const umbel_vec3* points, size_t count,
                                   uint32_t threads, uint8_t* results) {
  return capi::contains(capi::queried(tree), points, count, threads, results);
}

umbel_result umbel_kdtree_signed_distance(const umbel_kdtree* tree, const umbel_vec3* points,
                                          size_t count, uint32_t threads, float* results) {
  return capi::signed_distance(capi::queried(tree), points, count, threads, results);
}

umbel_result umbel_kdtree_overlaps_box(const umbel_kdtree* tree, const umbel_aabb* box,
                                       uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(tree), box, triangles, capacity, count);
}

umbel_result umbel_kdtree_overlaps_sphere(const umbel_kdtree* tree, const umbel_sphere* sphere,
                                          uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(tree), sphere, triangles, capacity, count);
}

umbel_result umbel_kdtree_overlaps_frustum(const umbel_kdtree* tree, const umbel_plane* planes,
                                           uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(tree), planes, triangles, capacity, count);
}
