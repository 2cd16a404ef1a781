// What a split of a kd-tree's cell costs by the surface area heuristic (MacDonald & Booth 1990),
// with the bonus for empty space of Wald & Havran 2006. In double: no mesh is so large or so small
// that areas overflow or vanish.
#pragma once

#include <algorithm>
#include <limits>

#include "base/simd/float4.hpp"
#include "query/cells.hpp"
#include "umbel/kdtree.hpp"

namespace umbel::kdtree {

/// Where to split a cell, and to which side triangles go that lie in the plane.
struct Split {
  double cost = std::numeric_limits<double>::infinity();
  float at = 0;
  uint32_t axis = 3;
  bool flat_below = false;

  bool exists() const { return axis < 3; }
  /// In an order in which the best does not depend on the order of the search.
  bool operator<(const Split& o) const {
    if (cost != o.cost) return cost < o.cost;
    if (axis != o.axis) return axis < o.axis;
    return at != o.at ? at < o.at : flat_below < o.flat_below;
  }
};

/// What all of a build shares.
struct CostRule {
  double traversal, intersection, empty_factor;
  /// Added to every extent: far below what matters, but cells without area compare by length.
  double pad;
  uint32_t target_leaf_size;  ///< so few triangles are not split any more

  double area(const Aabb& cell) const {
    const double x = double(cell.max.x) - double(cell.min.x) + pad,
                 y = double(cell.max.y) - double(cell.min.y) + pad,
                 z = double(cell.max.z) - double(cell.min.z) + pad;
    return x * (y + z) + y * z;
  }
  double leaf(size_t count) const { return intersection * double(count); }
};

/// Costs of planes across one axis of a cell.
class PlaneCost {
 public:
  PlaneCost(const CostRule& rule, const Aabb& cell, uint32_t axis)
      : PlaneCost(rule, cell, axis, rule.intersection / rule.area(cell)) {}
  /// With what is the same for all axes.
  PlaneCost(const CostRule& rule, const Aabb& cell, uint32_t axis, double scale)
      : rule_(rule),
        axis_(axis),
        low_(component(cell.min, axis)),
        high_(component(cell.max, axis)),
        scale_(scale) {
    const auto extent = [&](uint32_t a) {
      return double(component(cell.max, a)) - double(component(cell.min, a)) + rule.pad;
    };
    const double b = extent((axis + 1) % 3), c = extent((axis + 2) % 3);
    slope_ = b + c;
    base_ = b * c;
  }

  uint32_t axis() const { return axis_; }
  float low() const { return low_; }
  float high() const { return high_; }

  /// Of a plane with that many triangles on its sides.
  double operator()(float at, size_t below, size_t above) const {
    const double area_below = (double(at) - double(low_) + rule_.pad) * slope_ + base_;
    const double area_above = (double(high_) - double(at) + rule_.pad) * slope_ + base_;
    const double cost =
        rule_.traversal + scale_ * (area_below * double(below) + area_above * double(above));
    return below == 0 || above == 0 ? cost * rule_.empty_factor : cost;
  }

  /// No plane between these shares of the extent that has so many triangles on its sides, or more,
  /// costs less; nor does one that rounding has moved there.
  double bound(double from, double to, size_t below, size_t above) const {
    const double share = below >= above ? from : to;
    const double extent = double(high_) - double(low_);
    const double area_below = share * extent * slope_ + base_;
    const double area_above = (1 - share) * extent * slope_ + base_;
    const double rounding = rule_.intersection * 0x1p-20 * double(below + above);
    const double cost =
        rule_.traversal + scale_ * (area_below * double(below) + area_above * double(above));
    return (below == 0 || above == 0 ? cost * rule_.empty_factor : cost) - rounding;
  }

  /// The same for four planes at once, in single precision. What is rounded are shares of the
  /// cell's extent and area, so no coordinates are too large or too small.
  class FourPlanes {
   public:
    explicit FourPlanes(const PlaneCost& c) {
      const double extent = double(c.high_) - double(c.low_) + 2 * c.rule_.pad;
      middle_ = splat(static_cast<float>((double(c.low_) + double(c.high_)) / 2));
      to_share_ = splat(static_cast<float>(2 / extent));
      fixed_ = splat(static_cast<float>(c.scale_ * (c.base_ + extent * c.slope_ / 2)));
      moving_ = splat(static_cast<float>(c.scale_ * extent * c.slope_ / 2));
      traversal_ = splat(static_cast<float>(c.rule_.traversal));
      empty_ = splat(static_cast<float>(c.rule_.empty_factor));
    }
    Float4 operator()(Float4 at, Int4 below, Int4 above) const {
      const Float4 moved = (at - middle_) * to_share_ * moving_;
      const auto below_f = __builtin_convertvector(below, Float4);
      const auto above_f = __builtin_convertvector(above, Float4);
      const Float4 sum = traversal_ + (fixed_ + moved) * below_f + (fixed_ - moved) * above_f;
      const Int4 is_empty = (below == 0) | (above == 0);
      return is_empty ? sum * empty_ : sum;
    }

   private:
    Float4 middle_, to_share_, fixed_, moving_, traversal_, empty_;
  };

  /// The better of both sides for `flat` triangles that lie in the plane.
  void consider(float at, size_t below, size_t flat, size_t above, Split& best) const {
    // At the end of a cell a plane can only separate triangles that lie in it.
    const bool at_low = at <= low_, at_high = at >= high_;
    if ((at_low || at_high) && flat == 0) return;
    if (!at_low) keep({(*this)(at, below, above + flat), at, axis_, false}, best);
    if (flat > 0 && !at_high) keep({(*this)(at, below + flat, above), at, axis_, true}, best);
  }

 private:
  static void keep(const Split& split, Split& best) {
    if (split < best) best = split;
  }

  const CostRule& rule_;
  uint32_t axis_;
  float low_, high_;
  double scale_, slope_, base_;
};

/// The two cells.
inline Aabb cell_below(const Aabb& cell, const Split& split) {
  return umbel::cell_below(cell, split.axis, split.at);
}
inline Aabb cell_above(const Aabb& cell, const Split& split) {
  return umbel::cell_above(cell, split.axis, split.at);
}

}  // namespace umbel::kdtree
