// The structs of umbel.h stand for the C++ ones in arrays, so that nothing is copied.
#include "capi/queries.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/parallel.hpp"
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

Vec3 vec(const umbel_vec3& v) { return {v.x, v.y, v.z}; }

}  // namespace

void intersect(const TriangleQueries& in, const umbel_ray* rays, size_t count,
               const umbel_ray_options* options, umbel_hit* hits) {
  const RayQuery query = ray_query(rays, count, options);
  in.intersect(query.rays, elements<Hit>(hits, count, "hits"), query.options, query.threads);
}

void occluded(const TriangleQueries& in, const umbel_ray* rays, size_t count,
              const umbel_ray_options* options, uint8_t* results) {
  const RayQuery query = ray_query(rays, count, options);
  in.occluded(query.rays, elements<uint8_t>(results, count, "results"), query.options,
              query.threads);
}

void all_hits(const TriangleQueries& in, const umbel_ray* rays, size_t count,
              const umbel_ray_options* options, size_t hits_per_ray, umbel_hit* hits,
              uint32_t* hit_counts) {
  const RayQuery query = ray_query(rays, count, options);
  const auto counts = elements<uint32_t>(hit_counts, count, "hit_counts");
  if (hits_per_ray > kNone || (count > 0 && hits_per_ray > SIZE_MAX / sizeof(Hit) / count))
    throw Error(ErrorCode::kInvalidArgument,
                "hits_per_ray is " + std::to_string(hits_per_ray) + ", which no array could hold");
  const auto room = elements<Hit>(hits, count * hits_per_ray, "hits");
  with_threads(query.threads, [&] {
    parallel_for(count, 64, [&](size_t i) {
      counts[i] = static_cast<uint32_t>(
          in.all_hits(query.rays[i], room.subspan(i * hits_per_ray, hits_per_ray), query.options));
    });
  });
}

void closest_point(const TriangleQueries& in, const umbel_vec3* points, size_t count,
                   float max_distance, uint32_t threads, umbel_closest_point* results) {
  if (!(max_distance >= 0))
    throw Error(ErrorCode::kInvalidArgument,
                "max_distance is " + std::to_string(max_distance) + ", but must not be negative");
  in.closest_point(elements<const Vec3>(points, count, "points"),
                   elements<ClosestPoint>(results, count, "results"), max_distance, threads);
}

void contains(const TriangleQueries& in, const umbel_vec3* points, size_t count, uint32_t threads,
              uint8_t* results) {
  in.contains(elements<const Vec3>(points, count, "points"),
              elements<uint8_t>(results, count, "results"), threads);
}

void signed_distance(const TriangleQueries& in, const umbel_vec3* points, size_t count,
                     uint32_t threads, float* results) {
  in.signed_distance(elements<const Vec3>(points, count, "points"),
                     elements<float>(results, count, "results"), threads);
}

std::vector<uint32_t> overlaps(const TriangleQueries& in, const umbel_aabb* box) {
  const umbel_aabb& given = required(box, "box");
  return in.overlaps(Aabb{vec(given.min), vec(given.max)});
}

std::vector<uint32_t> overlaps(const TriangleQueries& in, const umbel_sphere* sphere) {
  const umbel_sphere& given = required(sphere, "sphere");
  return in.overlaps(Sphere{vec(given.center), given.radius});
}

std::vector<uint32_t> overlaps(const TriangleQueries& in, const umbel_plane* planes) {
  const auto given = elements<const Plane>(planes, 6, "planes");
  Frustum frustum;
  std::copy(given.begin(), given.end(), frustum.begin());
  return in.overlaps(frustum);
}

}  // namespace umbel::capi
