// Trees over boxes that come and go, from C (umbel_dynamic_bvh.h).
#include "umbel/dynamic_bvh.hpp"

#include <algorithm>
#include <bit>
#include <limits>

#include "base/fields.hpp"
#include "capi/bvh2_output.hpp"
#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "umbel/kdtree_traverse.hpp"
#include "umbel/umbel_dynamic_bvh.h"

struct umbel_dynamic_tree {
  umbel::bvh::DynamicTree tree;
};

namespace umbel::capi {
namespace {

using bvh::DynamicTree;

DynamicTree& tree_of(umbel_dynamic_tree* tree) { return required(tree, "tree").tree; }
const DynamicTree& tree_of(const umbel_dynamic_tree* tree) { return required(tree, "tree").tree; }

Aabb box_of(const umbel_aabb* box) { return std::bit_cast<Aabb>(required(box, "box")); }
umbel_aabb as_c(const Aabb& box) { return std::bit_cast<umbel_aabb>(box); }

/// A function of the caller, which must be there.
template <typename Function>
Function called(Function function, const char* name) {
  if (function) return function;
  throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is NULL");
}

/// Calls hit() for the primitives whose boxes a ray meets, and returns the last limit.
template <typename HitTest>
float traverse_ray(const DynamicTree& tree, const Ray& ray, const HitTest& hit) {
  if (!kdtree::detail::is_sound(ray)) return ray.t_max;
  const kdtree::detail::RayPlanes planes(ray);
  const double last = bvh::traverse_ordered(
      tree,
      [&](const Aabb& box) {
        const auto part = planes.within(box, {ray.t_min, ray.t_max});
        return part.from <= part.to ? part.from : std::numeric_limits<double>::infinity();
      },
      [&](uint32_t primitive) { return static_cast<double>(hit(primitive)); });
  return static_cast<float>(std::min<double>(last, ray.t_max));
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;
using namespace umbel::capi;

umbel_result umbel_dynamic_tree_build(const umbel_aabb* boxes, size_t box_count,
                                      const umbel_bvh_config* config,
                                      const umbel_build_options* options,
                                      umbel_dynamic_tree** tree) {
  return hand_out(tree, "tree", [&] {
    const auto given = elements<const Aabb>(boxes, box_count, "boxes");
    return umbel_dynamic_tree{
        DynamicTree::build(given, bvh_config(config).tree, build_options(options))};
  });
}

void umbel_dynamic_tree_free(umbel_dynamic_tree* tree) { delete tree; }

// ---- changes -----------------------------------------------------------------------------------

umbel_result umbel_dynamic_tree_insert(umbel_dynamic_tree* tree, const umbel_aabb* box,
                                       uint32_t* primitive) {
  if (primitive) *primitive = UMBEL_NONE;
  return guard([&] {
    DynamicTree& to = tree_of(tree);
    uint32_t& number = required(primitive, "primitive");
    number = to.insert(box_of(box));
  });
}

umbel_result umbel_dynamic_tree_remove(umbel_dynamic_tree* tree, uint32_t primitive) {
  return guard([&] { tree_of(tree).remove(primitive); });
}

umbel_result umbel_dynamic_tree_move(umbel_dynamic_tree* tree, uint32_t primitive,
                                     const umbel_aabb* box) {
  return guard([&] { tree_of(tree).move(primitive, box_of(box)); });
}

umbel_result umbel_dynamic_tree_refit(umbel_dynamic_tree* tree, const uint32_t* primitives,
                                      const umbel_aabb* boxes, size_t count) {
  return guard([&] {
    tree_of(tree).refit(elements<const uint32_t>(primitives, count, "primitives"),
                        elements<const Aabb>(boxes, count, "boxes"));
  });
}

umbel_result umbel_dynamic_tree_rebuild(umbel_dynamic_tree* tree, const umbel_bvh_config* config,
                                        const umbel_build_options* options) {
  return guard([&] { tree_of(tree).rebuild(bvh_config(config).tree, build_options(options)); });
}

// ---- what there is -----------------------------------------------------------------------------

size_t umbel_dynamic_tree_size(const umbel_dynamic_tree* tree) {
  return tree ? tree->tree.size() : 0;
}

int umbel_dynamic_tree_contains(const umbel_dynamic_tree* tree, uint32_t primitive) {
  return tree && tree->tree.contains(primitive) ? 1 : 0;
}

umbel_result umbel_dynamic_tree_get_box(const umbel_dynamic_tree* tree, uint32_t primitive,
                                        umbel_aabb* box) {
  return guard([&] { required(box, "box") = as_c(tree_of(tree).box(primitive)); });
}

umbel_result umbel_dynamic_tree_get_bounds(const umbel_dynamic_tree* tree, umbel_aabb* bounds) {
  return guard([&] { required(bounds, "bounds") = as_c(tree_of(tree).bounds()); });
}

umbel_result umbel_dynamic_tree_get_quality(const umbel_dynamic_tree* tree,
                                            umbel_dynamic_tree_quality* quality) {
  return guard([&] {
    const bvh::DynamicQuality found = tree_of(tree).quality();
    umbel_dynamic_tree_quality result{};
    COPY_FIELDS(result, found, sah_cost, built_sah_cost);
    result.rebuild_advised = found.rebuild_advised;
    write_struct(result, quality, "quality");
  });
}

umbel_result umbel_dynamic_tree_snapshot(const umbel_dynamic_tree* tree, uint32_t max_leaf_size,
                                         umbel_bvh2* snapshot) {
  return hand_out_tree<bvh::Node>(snapshot, "snapshot",
                                  [&] { return tree_of(tree).snapshot(max_leaf_size); });
}

// ---- queries -----------------------------------------------------------------------------------

umbel_result umbel_dynamic_tree_overlaps_box(const umbel_dynamic_tree* tree, const umbel_aabb* box,
                                             uint32_t* primitives, size_t capacity, size_t* count) {
  return hand_out_found(primitives, "primitives", capacity, count,
                        [&] { return tree_of(tree).overlaps(box_of(box)); });
}

umbel_result umbel_dynamic_tree_traverse(const umbel_dynamic_tree* tree,
                                         umbel_dynamic_tree_enters enters,
                                         umbel_dynamic_tree_visit visit, void* user) {
  return guard([&] {
    const DynamicTree& of = tree_of(tree);
    called(enters, "enters");
    called(visit, "visit");
    bvh::traverse(
        of,
        [&](const Aabb& box) {
          const umbel_aabb given = as_c(box);
          return enters(user, &given) != 0;
        },
        [&](uint32_t primitive) { return visit(user, primitive) != 0; });
  });
}

umbel_result umbel_dynamic_tree_traverse_ordered(const umbel_dynamic_tree* tree,
                                                 umbel_dynamic_tree_key key,
                                                 umbel_dynamic_tree_search search, void* user,
                                                 double* limit) {
  return guard([&] {
    const DynamicTree& of = tree_of(tree);
    called(key, "key");
    called(search, "search");
    const double last = bvh::traverse_ordered(
        of,
        [&](const Aabb& box) {
          const umbel_aabb given = as_c(box);
          return key(user, &given);
        },
        [&](uint32_t primitive) { return search(user, primitive); });
    if (limit) *limit = last;
  });
}

umbel_result umbel_dynamic_tree_traverse_ray(const umbel_dynamic_tree* tree, const umbel_ray* ray,
                                             umbel_dynamic_tree_hit hit, void* user, float* limit) {
  return guard([&] {
    const DynamicTree& of = tree_of(tree);
    const Ray given = std::bit_cast<Ray>(required(ray, "ray"));
    called(hit, "hit");
    const float last =
        traverse_ray(of, given, [&](uint32_t primitive) { return hit(user, primitive); });
    if (limit) *limit = last;
  });
}
