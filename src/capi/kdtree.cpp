// Kd-trees from C (umbel_kdtree.h).
#include "umbel/kdtree.hpp"

#include <algorithm>

#include "capi/bvh_input.hpp"
#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/queries.hpp"
#include "capi/structs.hpp"
#include "umbel/kdtree_traverse.hpp"
#include "umbel/umbel_kdtree.h"

/// What a C caller holds.
struct umbel_kdtree {
  umbel::kdtree::KdTree tree;
};
struct umbel_box_kdtree {
  umbel::kdtree::Tree tree;
  std::vector<umbel::Aabb> boxes;
  umbel::bvh::CostModel cost;
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
  result.target_leaf_size = config.tree.target_leaf_size;
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
  result.simd = static_cast<Simd>(given.simd);
  result.tree.target_leaf_size = given.target_leaf_size;
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
    const kdtree::KdTree& of = capi::required(tree, "tree").tree;
    capi::write_struct(capi::kdtree_statistics(of.statistics(), of.triangle_count(), of.bounds()),
                       statistics, "statistics");
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

// ---- over boxes --------------------------------------------------------------------------------

umbel_result umbel_box_kdtree_build(const umbel_aabb* boxes, size_t box_count,
                                    const umbel_kdtree_config* config,
                                    const umbel_build_options* options, umbel_box_kdtree** tree) {
  return capi::hand_out(tree, "tree", [&] {
    const auto given = capi::elements<const Aabb>(boxes, box_count, "boxes");
    const kdtree::Config settings = capi::kdtree_config(config).tree;
    return umbel_box_kdtree{kdtree::build(given, settings, capi::build_options(options)),
                            {given.begin(), given.end()},
                            settings.cost};
  });
}

void umbel_box_kdtree_free(umbel_box_kdtree* tree) { delete tree; }

umbel_result umbel_box_kdtree_get_statistics(const umbel_box_kdtree* tree,
                                             umbel_kdtree_statistics* statistics) {
  return capi::guard([&] {
    const umbel_box_kdtree& of = capi::required(tree, "tree");
    capi::write_struct(
        capi::kdtree_statistics(kdtree::statistics(of.tree, of.cost),
                                static_cast<uint32_t>(of.boxes.size()), of.tree.bounds),
        statistics, "statistics");
  });
}

umbel_result umbel_box_kdtree_traverse(const umbel_box_kdtree* tree, const umbel_ray* ray,
                                       umbel_kdtree_visit visit, void* user, float* limit) {
  return capi::guard([&] {
    const kdtree::Tree& of = capi::required(tree, "tree").tree;
    if (!visit) throw Error(ErrorCode::kInvalidArgument, "visit is NULL");
    const Ray& given = *capi::elements<const Ray>(&capi::required(ray, "ray"), 1, "ray").data();
    const float last = kdtree::traverse(of, given, [&](std::span<const uint32_t> primitives) {
      return visit(user, primitives.data(), primitives.size());
    });
    if (limit) *limit = last;
  });
}

umbel_result umbel_box_kdtree_overlaps_box(const umbel_box_kdtree* tree, const umbel_aabb* box,
                                           uint32_t* primitives, size_t capacity, size_t* count) {
  return capi::hand_out_found(primitives, "primitives", capacity, count, [&] {
    const umbel_box_kdtree& of = capi::required(tree, "tree");
    const Aabb& region = *capi::elements<const Aabb>(&capi::required(box, "box"), 1, "box").data();
    return kdtree::overlaps(of.tree, of.boxes, region);
  });
}
