// The last levels of a kd-tree: few triangles, held as boxes, for which every plane is tried by
// counting. Faster than to keep events sorted, and the same planes are found.
#pragma once

#include <span>

#include "kdtree/clip.hpp"
#include "kdtree/grow.hpp"

namespace umbel::kdtree {

class SmallSet {
 public:
  static constexpr uint32_t kMost = 24;

  explicit SmallSet(const Primitives& primitives) : primitives_(primitives) {}

  uint32_t size() const { return count_; }
  std::span<const uint32_t> triangles() const { return {triangle_, count_}; }

  void push(uint32_t triangle, const Aabb& box) {
    for (uint32_t axis = 0; axis < 3; ++axis) {
      low_[axis][count_] = component(box.min, axis);
      high_[axis][count_] = component(box.max, axis);
    }
    triangle_[count_++] = triangle;
  }

  /// Expects `left` as Grower does. Returns the expected cost of a line through the cell.
  double grow(const CostRule& rule, const Aabb& cell, const Allowance& left, Subtree& out) const;

 private:
  Split best_split(const CostRule& rule, const Aabb& cell) const;
  bool list_planes(const PlaneCost& cost, float* planes, uint32_t& count) const;
  void search_axis(const PlaneCost& cost, const float* planes, uint32_t count, Split& best) const;
  void search_flat(const PlaneCost& cost, Split& best) const;
  bool split(const Aabb& cell, const Split& split, uint64_t spare, SmallSet& below,
             SmallSet& above) const;

  static constexpr uint32_t kLanes = 8, kMostPlanes = 2 * kMost + kLanes;
  const Primitives& primitives_;
  uint32_t count_ = 0;
  uint32_t triangle_[kMost];
  float low_[3][kMost], high_[3][kMost];
};

}  // namespace umbel::kdtree
