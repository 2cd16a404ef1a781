// When a subtree is cheaper as one leaf, for builders that decide it while they build.
#pragma once

#include "base/exec.hpp"
#include "base/math.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// Costs in units of area times the cost model's.
struct LeafRule {
  float traversal, intersection;
  uint32_t max_leaf_size;

  explicit LeafRule(const Config& config) : LeafRule(config.cost, config.max_leaf_size) {}
  LeafRule(const CostModel& cost, uint32_t leaf_size)
      : traversal(cost.traversal), intersection(cost.intersection), max_leaf_size(leaf_size) {}

  UMBEL_HOST_DEVICE static float area(const Aabb& b) {
    const Vec3 d = b.max - b.min;
    return d.x * d.y + d.y * d.z + d.z * d.x;
  }
  UMBEL_HOST_DEVICE float leaf_cost(const Aabb& box, uint32_t count) const {
    return area(box) * (intersection * static_cast<float>(count));
  }
  UMBEL_HOST_DEVICE float inner_cost(const Aabb& box, float left, float right) const {
    return area(box) * traversal + (left + right);
  }
  /// Of `count` primitives below two children of these costs: as an inner node or as a leaf.
  UMBEL_HOST_DEVICE float cheaper(const Aabb& box, uint32_t count, float left, float right) const {
    const float inner = inner_cost(box, left, right);
    if (count > max_leaf_size) return inner;
    const float leaf = leaf_cost(box, count);
    return leaf < inner ? leaf : inner;
  }
};

}  // namespace umbel::bvh
