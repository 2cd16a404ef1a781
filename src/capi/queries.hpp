// What every structure over triangles answers, for the C functions that ask one.
#pragma once

#include "capi/bvh_input.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/triangle_queries.hpp"
#include "umbel/umbel_kdtree.h"

namespace umbel::capi {

/// The structure that a C function was given, and the name of that argument.
struct Queried {
  const TriangleQueries* structure;
  const char* name;
};

umbel_result intersect(Queried in, const umbel_ray* rays, size_t count,
                       const umbel_ray_options* options, umbel_hit* hits) noexcept;
umbel_result occluded(Queried in, const umbel_ray* rays, size_t count,
                      const umbel_ray_options* options, uint8_t* results) noexcept;
umbel_result all_hits(Queried in, const umbel_ray* rays, size_t count,
                      const umbel_ray_options* options, size_t hits_per_ray, umbel_hit* hits,
                      uint32_t* hit_counts) noexcept;
umbel_result closest_point(Queried in, const umbel_vec3* points, size_t count, float max_distance,
                           uint32_t threads, umbel_closest_point* results) noexcept;
umbel_result contains(Queried in, const umbel_vec3* points, size_t count, uint32_t threads,
                      uint8_t* results) noexcept;
umbel_result signed_distance(Queried in, const umbel_vec3* points, size_t count, uint32_t threads,
                             float* results) noexcept;

umbel_result overlaps(Queried in, const umbel_aabb* box, uint32_t* triangles, size_t capacity,
                      size_t* count) noexcept;
umbel_result overlaps(Queried in, const umbel_sphere* sphere, uint32_t* triangles, size_t capacity,
                      size_t* count) noexcept;
/// `planes`: six.
umbel_result overlaps(Queried in, const umbel_plane* planes, uint32_t* triangles, size_t capacity,
                      size_t* count) noexcept;

/// Of a kd-tree, or of a structure that is measured as one.
umbel_kdtree_statistics kdtree_statistics(const kdtree::Statistics& found, uint32_t triangle_count,
                                          const Aabb& bounds);

}  // namespace umbel::capi
