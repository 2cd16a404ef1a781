#include "umbel/ray_arrays.hpp"

#include "bvh/ray_batches.hpp"

namespace umbel {

size_t ray_count(const RayArrays& rays) {
  if (rays.origins.empty() || rays.directions.empty()) {
    if (rays.origins.size() <= 1 && rays.directions.size() <= 1) return 0;
    batches::check_length(rays.directions.size(), "directions", rays.origins.size());
    batches::check_length(rays.origins.size(), "origins", rays.directions.size());
  }
  const size_t count = rays.origins.size() == 1 ? rays.directions.size() : rays.origins.size();
  batches::check_length(rays.directions.size(), "directions", count);
  if (!rays.t_min.empty()) batches::check_length(rays.t_min.size(), "t_min", count);
  if (!rays.t_max.empty()) batches::check_length(rays.t_max.size(), "t_max", count);
  return count;
}

void intersect(const TriangleBvh& bvh, const RayArrays& rays, const HitArrays& hits,
               const RayOptions& options, uint32_t threads) {
  batches::intersect(bvh, rays, hits, options, threads);
}

void occluded(const TriangleBvh& bvh, const RayArrays& rays, std::span<uint8_t> results,
              const RayOptions& options, uint32_t threads) {
  batches::occluded(bvh, rays, results, options, threads);
}

AllHits all_hits(const TriangleBvh& bvh, const RayArrays& rays, size_t max_hits,
                 const RayOptions& options, uint32_t threads) {
  return batches::all_hits(bvh, rays, max_hits, options, threads);
}

}  // namespace umbel
