// The structs of umbel_bvh.h stand for the C++ ones in arrays, so that nothing is copied.
#include "capi/queries.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "base/fields.hpp"
#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "capi/hand_out.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {
namespace {

static_assert(offsetof(umbel_ray, direction) == offsetof(Ray, direction));
static_assert(offsetof(umbel_ray, t_max) == offsetof(Ray, t_max));
static_assert(offsetof(umbel_hit, primitive) == offsetof(Hit, primitive));
static_assert(offsetof(umbel_hit, u) == offsetof(Hit, u));
static_assert(offsetof(umbel_closest_point, primitive) == offsetof(ClosestPoint, primitive));
static_assert(offsetof(umbel_closest_point, u) == offsetof(ClosestPoint, u));

const TriangleQueries& queried(Queried in) { return required(in.structure, in.name); }

struct RayQuery {
  const TriangleQueries& structure;
  std::span<const Ray> rays;
  RayOptions options;
  uint32_t threads = 0;
};

RayQuery ray_query(Queried in, const umbel_ray* rays, size_t count,
                   const umbel_ray_options* options) {
  const TriangleQueries& structure = queried(in);
  RayQuery query{structure, elements<const Ray>(rays, count, "rays"), {}, 0};
  if (!options) return query;
  const umbel_ray_options given = read_struct(options, "options");
  query.options = {given.mask, given.cull_back_faces != 0};
  query.threads = given.threads;
  return query;
}

Vec3 vec(const umbel_vec3& v) { return {v.x, v.y, v.z}; }

/// Hands out the triangles that overlap the region that region() makes.
template <typename Region>
umbel_result overlaps_of(Queried in, const Region& region, uint32_t* triangles, size_t capacity,
                         size_t* count) noexcept {
  return hand_out_found(triangles, "triangles", capacity, count,
                        [&] { return queried(in).overlaps(region()); });
}

}  // namespace

umbel_result intersect(Queried in, const umbel_ray* rays, size_t count,
                       const umbel_ray_options* options, umbel_hit* hits) noexcept {
  return guard([&] {
    const RayQuery query = ray_query(in, rays, count, options);
    query.structure.intersect(query.rays, elements<Hit>(hits, count, "hits"), query.options,
                              query.threads);
  });
}

umbel_result occluded(Queried in, const umbel_ray* rays, size_t count,
                      const umbel_ray_options* options, uint8_t* results) noexcept {
  return guard([&] {
    const RayQuery query = ray_query(in, rays, count, options);
    query.structure.occluded(query.rays, elements<uint8_t>(results, count, "results"),
                             query.options, query.threads);
  });
}

umbel_result all_hits(Queried in, const umbel_ray* rays, size_t count,
                      const umbel_ray_options* options, size_t hits_per_ray, umbel_hit* hits,
                      uint32_t* hit_counts) noexcept {
  return guard([&] {
    const RayQuery query = ray_query(in, rays, count, options);
    const auto counts = elements<uint32_t>(hit_counts, count, "hit_counts");
    if (hits_per_ray > kNone || (count > 0 && hits_per_ray > SIZE_MAX / sizeof(Hit) / count))
      throw Error(ErrorCode::kInvalidArgument, "hits_per_ray is " + std::to_string(hits_per_ray) +
                                                   ", which no array could hold");
    const auto room = elements<Hit>(hits, count * hits_per_ray, "hits");
    with_threads(query.threads, [&] {
      parallel_for(count, 64, [&](size_t i) {
        counts[i] = static_cast<uint32_t>(query.structure.all_hits(
            query.rays[i], room.subspan(i * hits_per_ray, hits_per_ray), query.options));
      });
    });
  });
}

umbel_result closest_point(Queried in, const umbel_vec3* points, size_t count, float max_distance,
                           uint32_t threads, umbel_closest_point* results) noexcept {
  return guard([&] {
    const TriangleQueries& structure = queried(in);
    if (!(max_distance >= 0))
      throw Error(ErrorCode::kInvalidArgument,
                  "max_distance is " + printed(max_distance) + ", but must not be negative");
    structure.closest_point(elements<const Vec3>(points, count, "points"),
                            elements<ClosestPoint>(results, count, "results"), max_distance,
                            threads);
  });
}

umbel_result contains(Queried in, const umbel_vec3* points, size_t count, uint32_t threads,
                      uint8_t* results) noexcept {
  return guard([&] {
    queried(in).contains(elements<const Vec3>(points, count, "points"),
                         elements<uint8_t>(results, count, "results"), threads);
  });
}

umbel_result signed_distance(Queried in, const umbel_vec3* points, size_t count, uint32_t threads,
                             float* results) noexcept {
  return guard([&] {
    queried(in).signed_distance(elements<const Vec3>(points, count, "points"),
                                elements<float>(results, count, "results"), threads);
  });
}

umbel_result overlaps(Queried in, const umbel_aabb* box, uint32_t* triangles, size_t capacity,
                      size_t* count) noexcept {
  const auto region = [&] {
    const umbel_aabb& given = required(box, "box");
    return Aabb{vec(given.min), vec(given.max)};
  };
  return overlaps_of(in, region, triangles, capacity, count);
}

umbel_result overlaps(Queried in, const umbel_sphere* sphere, uint32_t* triangles, size_t capacity,
                      size_t* count) noexcept {
  const auto region = [&] {
    const umbel_sphere& given = required(sphere, "sphere");
    return Sphere{vec(given.center), given.radius};
  };
  return overlaps_of(in, region, triangles, capacity, count);
}

umbel_result overlaps(Queried in, const umbel_plane* planes, uint32_t* triangles, size_t capacity,
                      size_t* count) noexcept {
  const auto region = [&] {
    const auto given = elements<const Plane>(planes, 6, "planes");
    Frustum frustum;
    std::copy(given.begin(), given.end(), frustum.begin());
    return frustum;
  };
  return overlaps_of(in, region, triangles, capacity, count);
}

umbel_kdtree_statistics kdtree_statistics(const kdtree::Statistics& found, uint32_t triangle_count,
                                          const Aabb& bounds) {
  umbel_kdtree_statistics result{};
  COPY_FIELDS(result, found, nodes, leaves, empty_leaves, max_depth);
  result.triangle_count = triangle_count;
  COPY_FIELDS(result, found, references, sah_cost, inner_visits, leaf_visits, tests, bytes);
  std::memcpy(&result.bounds, &bounds, sizeof bounds);
  return result;
}

}  // namespace umbel::capi
