// Rays, distances and overlaps of hierarchies from C.
#include "capi/hand_out.hpp"
#include "capi/queries.hpp"

using namespace umbel;

umbel_result umbel_bvh_intersect(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                 const umbel_ray_options* options, umbel_hit* hits) {
  return capi::guard(
      [&] { capi::intersect(capi::required(bvh, "bvh").bvh, rays, count, options, hits); });
}

umbel_result umbel_bvh_occluded(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                const umbel_ray_options* options, uint8_t* results) {
  return capi::guard(
      [&] { capi::occluded(capi::required(bvh, "bvh").bvh, rays, count, options, results); });
}

umbel_result umbel_bvh_all_hits(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                const umbel_ray_options* options, size_t hits_per_ray,
                                umbel_hit* hits, uint32_t* hit_counts) {
  return capi::guard([&] {
    capi::all_hits(capi::required(bvh, "bvh").bvh, rays, count, options, hits_per_ray, hits,
                   hit_counts);
  });
}

umbel_result umbel_bvh_closest_point(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                     float max_distance, uint32_t threads,
                                     umbel_closest_point* results) {
  return capi::guard([&] {
    capi::closest_point(capi::required(bvh, "bvh").bvh, points, count, max_distance, threads,
                        results);
  });
}

umbel_result umbel_bvh_contains(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                uint32_t threads, uint8_t* results) {
  return capi::guard(
      [&] { capi::contains(capi::required(bvh, "bvh").bvh, points, count, threads, results); });
}

umbel_result umbel_bvh_signed_distance(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                       uint32_t threads, float* results) {
  return capi::guard([&] {
    capi::signed_distance(capi::required(bvh, "bvh").bvh, points, count, threads, results);
  });
}

umbel_result umbel_bvh_overlaps_box(const umbel_bvh* bvh, const umbel_aabb* box,
                                    uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::hand_out_found(triangles, "triangles", capacity, count,
                              [&] { return capi::overlaps(capi::required(bvh, "bvh").bvh, box); });
}

umbel_result umbel_bvh_overlaps_sphere(const umbel_bvh* bvh, const umbel_sphere* sphere,
                                       uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::hand_out_found(triangles, "triangles", capacity, count, [&] {
    return capi::overlaps(capi::required(bvh, "bvh").bvh, sphere);
  });
}

umbel_result umbel_bvh_overlaps_frustum(const umbel_bvh* bvh, const umbel_plane* planes,
                                        uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::hand_out_found(triangles, "triangles", capacity, count, [&] {
    return capi::overlaps(capi::required(bvh, "bvh").bvh, planes);
  });
}
