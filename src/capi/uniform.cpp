// Uniform structures from C (umbel_uniform.h).
#include "umbel/uniform.hpp"

#include <memory>
#include <string>
#include <utility>

#include "capi/bvh_input.hpp"
#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/queries.hpp"
#include "capi/structs.hpp"
#include "umbel/umbel_uniform.h"

/// What a C caller holds.
struct umbel_uniform {
  std::unique_ptr<umbel::TriangleQueries> structure;
  umbel::uniform::Statistics statistics;
};

namespace umbel::capi {
namespace {

umbel_uniform_config default_config() {
  const uniform::GridConfig grid;
  const uniform::OctreeConfig octree;
  umbel_uniform_config result{};
  result.struct_size = sizeof result;
  result.structure = UMBEL_UNIFORM_GRID;
  result.density = grid.density;
  result.leaf_density = grid.leaf_density;
  result.max_references = grid.max_references;
  result.max_depth = octree.max_depth;
  result.simd = static_cast<uint32_t>(grid.simd);
  result.traversal_cost = grid.cost.traversal;
  result.intersection_cost = grid.cost.intersection;
  return result;
}

template <typename Structure, typename Config>
umbel_uniform build(Config config, const umbel_uniform_config& given, const umbel_bvh_mesh* mesh,
                    const umbel_build_options* options) {
  config.compact = given.compact != 0;
  config.simd = static_cast<Simd>(given.simd);
  config.cost = {given.traversal_cost, given.intersection_cost};
  if (given.drop_invalid) config.invalid = bvh::InvalidTriangles::kDrop;
  const BvhMesh input = bvh_mesh(mesh);
  auto made = std::make_unique<Structure>(
      Structure::build(input.view, config, input.masks, build_options(options)));
  const uniform::Statistics statistics = made->statistics();
  return {std::move(made), statistics};
}

umbel_uniform build(const umbel_uniform_config& given, const umbel_bvh_mesh* mesh,
                    const umbel_build_options* options) {
  if (given.structure == UMBEL_UNIFORM_GRID) {
    const uniform::GridConfig config{.density = given.density,
                                     .leaf_density = given.leaf_density,
                                     .max_references = given.max_references};
    return build<uniform::TwoLevelGrid>(config, given, mesh, options);
  }
  if (given.structure == UMBEL_UNIFORM_OCTREE) {
    uniform::OctreeConfig config{.max_depth = given.max_depth,
                                 .max_references = given.max_references};
    if (given.max_leaf_size != 0) config.max_leaf_size = given.max_leaf_size;
    return build<uniform::Octree>(config, given, mesh, options);
  }
  if (given.structure == UMBEL_UNIFORM_INTERVALS) {
    uniform::IntervalConfig config;
    if (given.max_leaf_size != 0) config.max_leaf_size = given.max_leaf_size;
    return build<uniform::IntervalHierarchy>(config, given, mesh, options);
  }
  throw Error(ErrorCode::kInvalidArgument,
              "structure " + std::to_string(given.structure) + " does not exist");
}

Queried queried(const umbel_uniform* structure) {
  return {structure ? structure->structure.get() : nullptr, "structure"};
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

void umbel_uniform_config_init_sized(umbel_uniform_config* config, size_t size) {
  capi::init_sized(config, size, capi::default_config());
}

umbel_result umbel_uniform_build(const umbel_bvh_mesh* mesh, const umbel_uniform_config* config,
                                 const umbel_build_options* options, umbel_uniform** structure) {
  return capi::hand_out(structure, "structure", [&] {
    const umbel_uniform_config given =
        config ? capi::read_struct(config, "config") : capi::default_config();
    return capi::build(given, mesh, options);
  });
}

void umbel_uniform_free(umbel_uniform* structure) { delete structure; }

umbel_result umbel_uniform_get_statistics(const umbel_uniform* structure,
                                          umbel_kdtree_statistics* statistics) {
  return capi::guard([&] {
    const umbel_uniform& of = capi::required(structure, "structure");
    capi::write_struct(capi::kdtree_statistics(of.statistics, of.structure->triangle_count(),
                                               of.structure->bounds()),
                       statistics, "statistics");
  });
}

// ---- queries -----------------------------------------------------------------------------------

umbel_result umbel_uniform_intersect(const umbel_uniform* structure, const umbel_ray* rays,
                                     size_t count, const umbel_ray_options* options,
                                     umbel_hit* hits) {
  return capi::intersect(capi::queried(structure), rays, count, options, hits);
}

umbel_result umbel_uniform_occluded(const umbel_uniform* structure, const umbel_ray* rays,
                                    size_t count, const umbel_ray_options* options,
                                    uint8_t* results) {
  return capi::occluded(capi::queried(structure), rays, count, options, results);
}

umbel_result umbel_uniform_all_hits(const umbel_uniform* structure, const umbel_ray* rays,
                                    size_t count, const umbel_ray_options* options,
                                    size_t hits_per_ray, umbel_hit* hits, uint32_t* hit_counts) {
  return capi::all_hits(capi::queried(structure), rays, count, options, hits_per_ray, hits,
                        hit_counts);
}

umbel_result umbel_uniform_closest_point(const umbel_uniform* structure, const umbel_vec3* points,
                                         size_t count, float max_distance, uint32_t threads,
                                         umbel_closest_point* results) {
  return capi::closest_point(capi::queried(structure), points, count, max_distance, threads,
                             results);
}

umbel_result umbel_uniform_contains(const umbel_uniform* structure, const umbel_vec3* points,
                                    size_t count, uint32_t threads, uint8_t* results) {
  return capi::contains(capi::queried(structure), points, count, threads, results);
}

umbel_result umbel_uniform_signed_distance(const umbel_uniform* structure, const umbel_vec3* points,
                                           size_t count, uint32_t threads, float* results) {
  return capi::signed_distance(capi::queried(structure), points, count, threads, results);
}

umbel_result umbel_uniform_overlaps_box(const umbel_uniform* structure, const umbel_aabb* box,
                                        uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(structure), box, triangles, capacity, count);
}

umbel_result umbel_uniform_overlaps_sphere(const umbel_uniform* structure,
                                           const umbel_sphere* sphere, uint32_t* triangles,
                                           size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(structure), sphere, triangles, capacity, count);
}

umbel_result umbel_uniform_overlaps_frustum(const umbel_uniform* structure,
                                            const umbel_plane* planes, uint32_t* triangles,
                                            size_t capacity, size_t* count) {
  return capi::overlaps(capi::queried(structure), planes, triangles, capacity, count);
}
