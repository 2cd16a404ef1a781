// Subtrees of a few thousand triangles, held as boxes. No events are kept: the ends of boxes are
// counted into intervals along each axis. The counts bound from below what any plane in an interval
// may cost. Only where that bound beats the best plane so far are the ends in the interval sorted
// and tried one by one. The plane that is found is that of a sweep over all events.
#pragma once

#include <vector>

#include "base/simd/box4.hpp"
#include "kdtree/small_set.hpp"

namespace umbel::kdtree {

class BoxGrower {
 public:
  /// With more boxes than this, events that stay sorted are faster.
  static constexpr uint32_t kMost = 1u << 12;

  BoxGrower(const Primitives& primitives, const CostRule& rule)
      : primitives_(primitives), rule_(rule) {}

  void push(uint32_t triangle, const Aabb& box);

  /// Of all that was pushed. Expects `left` as Grower does. Returns the expected cost of a line
  /// through the cell.
  double grow(const Aabb& cell, const Allowance& left, Subtree& out) {
    const auto count = static_cast<uint32_t>(items_.size());
    return grow({0, count, count}, cell, left, out);
  }

 private:
  static constexpr uint32_t kMostBins = 128, kMostIntervals = kMostBins + 2;

  struct Item {
    Float4 low, high;  ///< lane 3 is zero
    uint32_t triangle;
    Aabb box() const { return {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}}; }
  };
  /// Some items, and where the room behind all that are needed begins.
  struct Span {
    uint32_t first, count, top;
  };
  /// An interval in which the best plane may lie, and how many triangles begin before and end after
  /// it.
  struct Interval {
    double bound;
    uint32_t axis, number, before, after;
    bool operator<(const Interval& o) const {
      if (bound != o.bound) return bound < o.bound;
      return axis != o.axis ? axis < o.axis : number < o.number;
    }
  };

  double grow(const Span& span, const Aabb& cell, const Allowance& left, Subtree& out);
  double grow_small(const Span& span, const Aabb& cell, const Allowance& left, Subtree& out) const;
  Split best_split(const Span& span, const Aabb& cell);
  void count(const Span& span, const Aabb& cell, uint32_t bins);
  void list_intervals(const PlaneCost& cost, uint32_t count, uint32_t bins);
  void sweep(const PlaneCost& cost, const Span& span, const Interval& interval, Split& best);
  void gather(const Span& span, uint32_t axis, uint32_t interval);
  bool split(const Span& span, const Aabb& cell, const Split& split, uint64_t spare, Span& below,
             Span& above);

  const Primitives& primitives_;
  const CostRule& rule_;
  std::vector<Item> items_;
  uint32_t begins_[3][kMostIntervals], ends_[3][kMostIntervals];
  std::vector<uint64_t>
      intervals_of_;  ///< of each box a byte an end: low x, y, z, -, high x, y, z, -
  std::vector<Interval> intervals_;
  std::vector<float> lows_, highs_, flats_;  ///< the ends in an interval
};

}  // namespace umbel::kdtree
