// Rays, distances and overlaps of kd-trees from C.
#include "capi/hand_out.hpp"
#include "capi/kdtree_input.hpp"
#include "capi/queries.hpp"

using namespace umbel;

umbel_result umbel_kdtree_intersect(const umbel_kdtree* tree, const umbel_ray* rays, size_t count,
                                    const umbel_ray_options* options, umbel_hit* hits) {
  return capi::guard(
      [&] { capi::intersect(capi::required(tree, "tree").tree, rays, count, options, hits); });
}

umbel_result umbel_kdtree_occluded(const umbel_kdtree* tree, const umbel_ray* rays, size_t count,
                                   const umbel_ray_options* options, uint8_t* results) {
  return capi::guard(
      [&] { capi::occluded(capi::required(tree, "tree").tree, rays, count, options, results); });
}

umbel_result umbel_kdtree_all_hits(const umbel_kdtree* tree, const umbel_ray* rays, size_t count,
                                   const umbel_ray_options* options, size_t hits_per_ray,
                                   umbel_hit* hits, uint32_t* hit_counts) {
  return capi::guard([&] {
    capi::all_hits(capi::required(tree, "tree").tree, rays, count, options, hits_per_ray, hits,
                   hit_counts);
  });
}

umbel_result umbel_kdtree_closest_point(const umbel_kdtree* tree, const umbel_vec3* points,
                                        size_t count, float max_distance, uint32_t threads,
                                        umbel_closest_point* results) {
  return capi::guard([&] {
    capi::closest_point(capi::required(tree, "tree").tree, points, count, max_distance, threads,
                        results);
  });
}

umbel_result umbel_kdtree_contains(const umbel_kdtree* tree, const umbel_vec3* points, size_t count,
                                   uint32_t threads, uint8_t* results) {
  return capi::guard(
      [&] { capi::contains(capi::required(tree, "tree").tree, points, count, threads, results); });
}

umbel_result umbel_kdtree_signed_distance(const umbel_kdtree* tree, const umbel_vec3* points,
                                          size_t count, uint32_t threads, float* results) {
  return capi::guard([&] {
    capi::signed_distance(capi::required(tree, "tree").tree, points, count, threads, results);
  });
}

umbel_result umbel_kdtree_overlaps_box(const umbel_kdtree* tree, const umbel_aabb* box,
                                       uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::hand_out_found(triangles, "triangles", capacity, count, [&] {
    return capi::overlaps(capi::required(tree, "tree").tree, box);
  });
}

umbel_result umbel_kdtree_overlaps_sphere(const umbel_kdtree* tree, const umbel_sphere* sphere,
                                          uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::hand_out_found(triangles, "triangles", capacity, count, [&] {
    return capi::overlaps(capi::required(tree, "tree").tree, sphere);
  });
}

umbel_result umbel_kdtree_overlaps_frustum(const umbel_kdtree* tree, const umbel_plane* planes,
                                           uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::hand_out_found(triangles, "triangles", capacity, count, [&] {
    return capi::overlaps(capi::required(tree, "tree").tree, planes);
  });
}
