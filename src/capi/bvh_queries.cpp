// Rays, distances and overlaps from C. The structs of umbel.h stand for the C++ ones in arrays, so
// that nothing is copied.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/parallel.hpp"
#include "capi/bvh_input.hpp"
#include "capi/guard.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {
namespace {

static_assert(offsetof(umbel_ray, direction) == offsetof(Ray, direction));
static_assert(offsetof(umbel_ray, t_max) == offsetof(Ray, t_max));
static_assert(offsetof(umbel_hit, primitive) == offsetof(Hit, primitive));
static_assert(offsetof(umbel_hit, u) == offsetof(Hit, u));
static_assert(offsetof(umbel_closest_point, primitive) == offsetof(ClosestPoint, primitive));
static_assert(offsetof(umbel_closest_point, u) == offsetof(ClosestPoint, u));

struct RayQuery {
  std::span<const Ray> rays;
  RayOptions options;
  uint32_t threads = 0;
};

RayQuery ray_query(const umbel_ray* rays, size_t count, const umbel_ray_options* options) {
  RayQuery query;
  query.rays = elements<const Ray>(rays, count, "rays");
  if (!options) return query;
  const umbel_ray_options given = read_struct(options, "options");
  query.options = {given.mask, given.cull_back_faces != 0};
  query.threads = given.threads;
  return query;
}

void all_hits(const TriangleBvh& bvh, const RayQuery& query, size_t hits_per_ray, umbel_hit* hits,
              std::span<uint32_t> counts) {
  const size_t count = query.rays.size();
  if (hits_per_ray > kNone || (count > 0 && hits_per_ray > SIZE_MAX / sizeof(Hit) / count))
    throw Error(ErrorCode::kInvalidArgument,
                "hits_per_ray is " + std::to_string(hits_per_ray) + ", which no array could hold");
  const auto room = elements<Hit>(hits, count * hits_per_ray, "hits");
  with_threads(query.threads, [&] {
    parallel_for(count, 64, [&](size_t i) {
      counts[i] = static_cast<uint32_t>(
          bvh.all_hits(query.rays[i], room.subspan(i * hits_per_ray, hits_per_ray), query.options));
    });
  });
}

/// The caller's array, or only the count where there is none.
void hand_out(const std::vector<uint32_t>& found, uint32_t* triangles, size_t capacity,
              size_t* count) {
  required(count, "count") = found.size();
  if (!triangles) {
    if (capacity > 0) elements<uint32_t>(triangles, capacity, "triangles");
    return;
  }
  if (found.size() > capacity)
    throw CapacityError{"triangles has room for " + std::to_string(capacity) + " of " +
                        std::to_string(found.size())};
  std::copy(found.begin(), found.end(), triangles);
}

Vec3 vec(const umbel_vec3& v) { return {v.x, v.y, v.z}; }

/// Runs find() and hands its triangles to the caller.
template <typename Find>
umbel_result overlaps(uint32_t* triangles, size_t capacity, size_t* count, const Find& find) {
  if (count) *count = 0;
  return guard([&] {
    required(count, "count");
    hand_out(find(), triangles, capacity, count);
  });
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

umbel_result umbel_bvh_intersect(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                 const umbel_ray_options* options, umbel_hit* hits) {
  return capi::guard([&] {
    const capi::RayQuery query = capi::ray_query(rays, count, options);
    capi::required(bvh, "bvh")
        .bvh.intersect(query.rays, capi::elements<Hit>(hits, count, "hits"), query.options,
                       query.threads);
  });
}

umbel_result umbel_bvh_occluded(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                const umbel_ray_options* options, uint8_t* results) {
  return capi::guard([&] {
    const capi::RayQuery query = capi::ray_query(rays, count, options);
    capi::required(bvh, "bvh")
        .bvh.occluded(query.rays, capi::elements<uint8_t>(results, count, "results"), query.options,
                      query.threads);
  });
}

umbel_result umbel_bvh_all_hits(const umbel_bvh* bvh, const umbel_ray* rays, size_t count,
                                const umbel_ray_options* options, size_t hits_per_ray,
                                umbel_hit* hits, uint32_t* hit_counts) {
  return capi::guard([&] {
    const TriangleBvh& target = capi::required(bvh, "bvh").bvh;
    capi::all_hits(target, capi::ray_query(rays, count, options), hits_per_ray, hits,
                   capi::elements<uint32_t>(hit_counts, count, "hit_counts"));
  });
}

umbel_result umbel_bvh_closest_point(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                     float max_distance, uint32_t threads,
                                     umbel_closest_point* results) {
  return capi::guard([&] {
    if (!(max_distance >= 0))
      throw Error(ErrorCode::kInvalidArgument,
                  "max_distance is " + std::to_string(max_distance) + ", but must not be negative");
    capi::required(bvh, "bvh")
        .bvh.closest_point(capi::elements<const Vec3>(points, count, "points"),
                           capi::elements<ClosestPoint>(results, count, "results"), max_distance,
                           threads);
  });
}

umbel_result umbel_bvh_contains(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                uint32_t threads, uint8_t* results) {
  return capi::guard([&] {
    capi::required(bvh, "bvh")
        .bvh.contains(capi::elements<const Vec3>(points, count, "points"),
                      capi::elements<uint8_t>(results, count, "results"), threads);
  });
}

umbel_result umbel_bvh_signed_distance(const umbel_bvh* bvh, const umbel_vec3* points, size_t count,
                                       uint32_t threads, float* results) {
  return capi::guard([&] {
    capi::required(bvh, "bvh")
        .bvh.signed_distance(capi::elements<const Vec3>(points, count, "points"),
                             capi::elements<float>(results, count, "results"), threads);
  });
}

umbel_result umbel_bvh_overlaps_box(const umbel_bvh* bvh, const umbel_aabb* box,
                                    uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(triangles, capacity, count, [&] {
    const umbel_aabb& given = capi::required(box, "box");
    return capi::required(bvh, "bvh")
        .bvh.overlaps(Aabb{capi::vec(given.min), capi::vec(given.max)});
  });
}

umbel_result umbel_bvh_overlaps_sphere(const umbel_bvh* bvh, const umbel_sphere* sphere,
                                       uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(triangles, capacity, count, [&] {
    const umbel_sphere& given = capi::required(sphere, "sphere");
    return capi::required(bvh, "bvh").bvh.overlaps(Sphere{capi::vec(given.center), given.radius});
  });
}

umbel_result umbel_bvh_overlaps_frustum(const umbel_bvh* bvh, const umbel_plane* planes,
                                        uint32_t* triangles, size_t capacity, size_t* count) {
  return capi::overlaps(triangles, capacity, count, [&] {
    const auto given = capi::elements<const Plane>(planes, 6, "planes");
    Frustum frustum;
    std::copy(given.begin(), given.end(), frustum.begin());
    return capi::required(bvh, "bvh").bvh.overlaps(frustum);
  });
}
