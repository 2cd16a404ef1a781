#include "capi/bvh_input.hpp"

#include "base/fields.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {
namespace {

// What bvh::Config and umbel_bvh_config have in common.
#define TREE_CONFIG_FIELDS                                                                  \
  max_leaf_size, max_depth, ploc_sweep, atrbvh_bits, bins, spatial_budget, spatial_overlap, \
      morton_bits, hlbvh_bits, ploc_radius, treelet_size, treelet_rounds, reinsertion_rounds

static_assert(uint32_t{UMBEL_BVH_INSERTION} == uint32_t(bvh::Builder::kInsertion));
static_assert(uint32_t{UMBEL_BVH_KMEANS} == uint32_t(bvh::Builder::kKmeans));
static_assert(uint32_t{UMBEL_SIMD_AVX512} == uint32_t(Simd::kAvx512));

}  // namespace

umbel_bvh_config as_c(const BvhConfig& config) {
  const bvh::Config& tree = config.tree;
  umbel_bvh_config result{};
  result.struct_size = sizeof result;
  result.builder = static_cast<uint32_t>(tree.builder);
  result.traversal_cost = tree.cost.traversal;
  result.intersection_cost = tree.cost.intersection;
  result.drop_invalid = tree.invalid == bvh::InvalidTriangles::kDrop;
  COPY_FIELDS(result, tree, TREE_CONFIG_FIELDS);
  result.kmeans_clusters = tree.kmeans.clusters;
  result.kmeans_candidates = tree.kmeans.candidates;
  result.kmeans_iterations = tree.kmeans.iterations;
  result.kmeans_manhattan = tree.kmeans.distance == bvh::KmeansDistance::kManhattan;
  result.aac_leaf_size = tree.aac.leaf_size;
  result.aac_epsilon = tree.aac.epsilon;
  result.width = config.width;
  result.compact = config.compact;
  result.simd = static_cast<uint32_t>(config.simd);
  result.kmeans_forwarded_clusters = tree.kmeans.forwarded_clusters;
  return result;
}

BvhConfig bvh_config(const umbel_bvh_config* config) {
  if (!config) return {};
  const umbel_bvh_config given = read_struct(config, "config");
  BvhConfig result;
  bvh::Config& tree = result.tree;
  tree.builder = static_cast<bvh::Builder>(given.builder);
  tree.cost = {given.traversal_cost, given.intersection_cost};
  tree.invalid = given.drop_invalid ? bvh::InvalidTriangles::kDrop : bvh::InvalidTriangles::kRefuse;
  COPY_FIELDS(tree, given, TREE_CONFIG_FIELDS);
  tree.kmeans = kmeans_config(given);
  tree.aac = {given.aac_leaf_size, given.aac_epsilon};
  result.width = given.width;
  result.compact = given.compact != 0;
  result.simd = static_cast<Simd>(given.simd);
  return result;
}

BvhMesh bvh_mesh(const umbel_bvh_mesh* mesh) {
  const umbel_bvh_mesh given = read_struct(mesh, "mesh");
  check_nameable(given.position_count, "mesh->position_count");
  check_nameable(given.triangle_count, "mesh->triangle_count");
  BvhMesh result;
  result.view.positions = strided(given.positions, given.position_count, given.position_stride,
                                  "mesh->positions", result.copied_positions);
  const auto corners =
      elements<const uint32_t>(given.triangles, 3 * given.triangle_count, "mesh->triangles");
  result.view.triangles = {reinterpret_cast<const Triangle*>(corners.data()), given.triangle_count};
  if (given.masks) result.masks = {given.masks, given.triangle_count};
  return result;
}

}  // namespace umbel::capi
