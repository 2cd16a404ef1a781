// What every structure over triangles answers, for the C functions that ask one.
#pragma once

#include "capi/bvh_input.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::capi {

/// Of a call's `threads`, `mask` and so on where they matter; arrays are the caller's. All throw.
void intersect(const TriangleQueries& in, const umbel_ray* rays, size_t count,
               const umbel_ray_options* options, umbel_hit* hits);
void occluded(const TriangleQueries& in, const umbel_ray* rays, size_t count,
              const umbel_ray_options* options, uint8_t* results);
void all_hits(const TriangleQueries& in, const umbel_ray* rays, size_t count,
              const umbel_ray_options* options, size_t hits_per_ray, umbel_hit* hits,
              uint32_t* hit_counts);
void closest_point(const TriangleQueries& in, const umbel_vec3* points, size_t count,
                   float max_distance, uint32_t threads, umbel_closest_point* results);
void contains(const TriangleQueries& in, const umbel_vec3* points, size_t count, uint32_t threads,
              uint8_t* results);
void signed_distance(const TriangleQueries& in, const umbel_vec3* points, size_t count,
                     uint32_t threads, float* results);

std::vector<uint32_t> overlaps(const TriangleQueries& in, const umbel_aabb* box);
std::vector<uint32_t> overlaps(const TriangleQueries& in, const umbel_sphere* sphere);
std::vector<uint32_t> overlaps(const TriangleQueries& in, const umbel_plane* planes);

}  // namespace umbel::capi
