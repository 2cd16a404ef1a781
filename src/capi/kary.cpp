// The tree of k-means clusters from C.
#include <cstddef>

#include "capi/bvh_trees.hpp"
#include "umbel/umbel_kary.h"

namespace umbel::capi {
namespace {

static_assert(offsetof(umbel_kary_node, children) == offsetof(bvh::KaryNode, children));
static_assert(offsetof(umbel_kary_node, count) == offsetof(bvh::KaryNode, count));

bvh::KaryTree tree_of(const umbel_kary* tree) { return copied_tree<bvh::KaryTree>(tree); }

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

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
    capi::write_struct(capi::as_c(bvh::statistics(copied, capi::bvh_config(config).tree.cost)),
                       statistics, "statistics");
  });
}

umbel_result umbel_bvh_from_kary(const umbel_kary* tree, const umbel_bvh_mesh* mesh,
                                 const umbel_bvh_config* config, const umbel_build_options* options,
                                 umbel_bvh** bvh) {
  return capi::hand_out(bvh, "bvh", [&] {
    const capi::BvhMesh given = capi::bvh_mesh(mesh);
    return umbel_bvh{TriangleBvh::widen(capi::tree_of(tree), given.view, capi::bvh_config(config),
                                        given.masks, capi::build_options(options))};
  });
}
