// The triangles of a cell as boxes, with planes searched between bins (Popov et al., "Experiences
// with Streaming Construction of SAH KD-Trees", 2006): faster than exact, and nearly as good.
#pragma once

#include <span>
#include <vector>

#include "kdtree/small_set.hpp"

namespace umbel::kdtree {

class BoxSet {
 public:
  struct Item {
    Aabb box;
    uint32_t triangle;
  };

  BoxSet() = default;
  BoxSet(const Primitives& primitives, const CostRule& rule, uint32_t bins, std::vector<Item> items)
      : primitives_(&primitives), rule_(&rule), bins_(bins), items_(std::move(items)) {}

  uint32_t size() const { return static_cast<uint32_t>(items_.size()); }
  bool is_small() const { return items_.size() <= SmallSet::kMost; }
  std::vector<uint32_t> triangles() const;
  Split best_split(const Aabb& cell) const;
  bool split(const Aabb& cell, const Split& split, uint64_t spare, BoxSet& below,
             BoxSet& above) const;
  double grow_small(const CostRule& rule, const Aabb& cell, const Allowance& left,
                    Subtree& out) const;

 private:
  const Primitives* primitives_ = nullptr;
  const CostRule* rule_ = nullptr;
  uint32_t bins_ = 0;
  std::vector<Item> items_;
};

}  // namespace umbel::kdtree
