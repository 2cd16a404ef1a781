// What a nearest-hit query does on average: the traversal of the ray kernels, counting.
#pragma once

#include <vector>

#include "bvh/wide/portable_intersector.hpp"

namespace bench {

struct TraversalCounts {
  double nodes = 0, leaves = 0, triangles = 0;
};

class CountingIntersector {
 public:
  static constexpr uint32_t kWidth = 8;
  static inline TraversalCounts counts;

  CountingIntersector(const umbel::RayFrame& frame, const umbel::BvhData& tree)
      : lanes_(frame, tree) {}

  uint32_t visit(uint32_t node, float cull, umbel::StackEntry*& top) const {
    ++counts.nodes;
    return lanes_.visit(node, cull, top);
  }
  uint32_t triangles(const umbel::BvhData& tree, uint32_t link, bool cull_back, float t_max,
                     umbel::LeafHits& hits) const {
    ++counts.leaves;
    counts.triangles += umbel::BvhData::leaf_size(link);
    return lanes_.triangles(tree, link, cull_back, t_max, hits);
  }

 private:
  umbel::PortableIntersector<kWidth> lanes_;
};

/// Means over the rays.
inline TraversalCounts count_traversal(const umbel::BvhData& tree,
                                       const std::vector<umbel::Ray>& rays) {
  TraversalCounts& counts = CountingIntersector::counts;
  counts = {};
  for (const umbel::Ray& ray : rays)
    umbel::intersect_ray<CountingIntersector, umbel::BvhData>(tree, ray, {});
  const auto n = static_cast<double>(rays.size());
  return {counts.nodes / n, counts.leaves / n, counts.triangles / n};
}

}  // namespace bench
