#include "kdtree/small_set.hpp"

#include "base/simd/box4.hpp"

namespace umbel::kdtree {

double SmallSet::grow(const CostRule& rule, const Aabb& cell, const Allowance& left,
                      Subtree& out) const {
  const double as_leaf = rule.leaf(count_);
  bool is_bad = false;
  Split best;
  // No subtree costs less than a visit of its root.
  if (as_leaf > rule.traversal && left.levels > 0) best = best_split(rule, cell);
  SmallSet below(primitives_), above(primitives_);
  if (!is_worth(rule, best, count_, left, is_bad) || !split(cell, best, left.spare, below, above)) {
    add_leaf(triangles(), out);
    return as_leaf;
  }
  const auto [first, second] = shares(left, count_, is_bad, below.count_, above.count_);
  const size_t node = out.nodes.size(), reference = out.references.size();
  const Aabb low = cell_below(cell, best), high = cell_above(cell, best);
  out.nodes.emplace_back();
  const double cost_below = below.grow(rule, low, first, out);
  const auto middle = static_cast<uint32_t>(out.nodes.size());
  const double cost_above = above.grow(rule, high, second, out);
  out.nodes[node] = Node::inner(best.axis, best.at, middle);
  const double cost =
      rule.traversal +
      (rule.area(low) * cost_below + rule.area(high) * cost_above) / rule.area(cell);
  if (cost < as_leaf) return cost;
  out.nodes.resize(node);
  out.references.resize(reference);
  add_leaf(triangles(), out);
  return as_leaf;
}

Split SmallSet::best_split(const CostRule& rule, const Aabb& cell) const {
  Split best;
  const double scale = rule.intersection / rule.area(cell);
  for (uint32_t axis = 0; axis < 3; ++axis) {
    if (!(component(cell.min, axis) < component(cell.max, axis))) continue;
    const PlaneCost cost(rule, cell, axis, scale);
    alignas(16) float planes[kMostPlanes];
    uint32_t count = 0;
    if (list_planes(cost, planes, count))
      search_axis(cost, planes, count, best);
    else
      search_flat(cost, best);
  }
  return best;
}

/// Those within the cell, some of them more than once, up to a multiple of four. False if there are
/// triangles in planes across the axis.
bool SmallSet::list_planes(const PlaneCost& cost, float* planes, uint32_t& count) const {
  const float *low = low_[cost.axis()], *high = high_[cost.axis()];
  bool has_flat = false;
  for (uint32_t i = 0; i < count_; ++i) {
    planes[count] = low[i];
    count += low[i] > cost.low();
    planes[count] = high[i];
    count += high[i] < cost.high();
    has_flat |= low[i] == high[i];
  }
  if (count == 0) return !has_flat;
  for (uint32_t k = 0; k < kLanes; ++k) planes[count + k] = planes[0];
  return !has_flat;
}

void SmallSet::search_axis(const PlaneCost& cost, const float* planes, uint32_t count,
                           Split& best) const {
  const float *low = low_[cost.axis()], *high = high_[cost.axis()];
  if (count == 0) return;
  const PlaneCost::FourPlanes four_planes(cost);
  Float4 least = splat(std::numeric_limits<float>::infinity()), where = splat(0);
  const auto keep = [&](Float4 plane, Int4 below, Int4 above) {
    const Float4 plane_cost = four_planes(plane, below, above);
    where = plane_cost < least ? plane : where;
    least = plane_cost < least ? plane_cost : least;
  };
  uint32_t k = 0;
  for (; k + 4 < count; k += 8) {
    const Float4 p = load4(planes + k), q = load4(planes + k + 4);
    Int4 p_below{}, p_above{}, q_below{}, q_above{};
    for (uint32_t i = 0; i < count_; ++i) {
      const Float4 l = splat(low[i]), h = splat(high[i]);
      // Comparisons give 0 or -1.
      p_below -= l < p;
      p_above -= h > p;
      q_below -= l < q;
      q_above -= h > q;
    }
    keep(p, p_below, p_above);
    keep(q, q_below, q_above);
  }
  if (k < count) {
    const Float4 p = load4(planes + k);
    Int4 below{}, above{};
    for (uint32_t i = 0; i < count_; ++i) {
      below -= splat(low[i]) < p;
      above -= splat(high[i]) > p;
    }
    keep(p, below, above);
  }
  if (double(std::min(std::min(least[0], least[1]), std::min(least[2], least[3]))) > best.cost)
    return;
  for (uint32_t lane = 0; lane < 4; ++lane) {
    const Split split{double(least[lane]), where[lane], cost.axis(), false};
    if (split < best) best = split;
  }
}

void SmallSet::search_flat(const PlaneCost& cost, Split& best) const {
  const float *low = low_[cost.axis()], *high = high_[cost.axis()];
  const auto consider = [&](float at) {
    uint32_t below = 0, above = 0, flat = 0;
    for (uint32_t i = 0; i < count_; ++i) {
      below += low[i] < at;
      above += high[i] > at;
      flat += low[i] == at && high[i] == at;
    }
    cost.consider(at, below, flat, above, best);
  };
  for (uint32_t i = 0; i < count_; ++i) {
    consider(low[i]);
    if (high[i] > low[i]) consider(high[i]);
  }
}

bool SmallSet::split(const Aabb& cell, const Split& split, uint64_t spare, SmallSet& below,
                     SmallSet& above) const {
  const float *low = low_[split.axis], *high = high_[split.axis];
  uint64_t repeats = 0;
  for (uint32_t i = 0; i < count_; ++i) {
    Aabb box{{low_[0][i], low_[1][i], low_[2][i]}, {high_[0][i], high_[1][i], high_[2][i]}};
    const bool is_flat = low[i] == high[i] && low[i] == split.at;
    if (is_flat ? split.flat_below : high[i] <= split.at) {
      below.push(triangle_[i], box);
    } else if (is_flat || low[i] >= split.at) {
      above.push(triangle_[i], box);
    } else {
      const Halves halves = primitives_.halves(triangle_[i], cell, split);
      const bool in_below = !is_empty(halves.below), in_above = !is_empty(halves.above);
      if (in_below) below.push(triangle_[i], halves.below);
      if (in_above) above.push(triangle_[i], halves.above);
      repeats += in_below && in_above ? 1 : 0;
    }
  }
  return repeats <= spare;
}

}  // namespace umbel::kdtree
