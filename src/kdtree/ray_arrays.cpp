#include "bvh/ray_batches.hpp"
#include "umbel/kdtree.hpp"

namespace umbel::kdtree {

void intersect(const KdTree& tree, const RayArrays& rays, const HitArrays& hits,
               const RayOptions& options, uint32_t threads) {
  batches::intersect(tree, rays, hits, options, threads);
}

void occluded(const KdTree& tree, const RayArrays& rays, std::span<uint8_t> results,
              const RayOptions& options, uint32_t threads) {
  batches::occluded(tree, rays, results, options, threads);
}

AllHits all_hits(const KdTree& tree, const RayArrays& rays, size_t max_hits,
                 const RayOptions& options, uint32_t threads) {
  return batches::all_hits(tree, rays, max_hits, options, threads);
}

}  // namespace umbel::kdtree
