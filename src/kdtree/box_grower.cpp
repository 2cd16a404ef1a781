#include "kdtree/box_grower.hpp"

#include <algorithm>
#include <bit>

#include "base/math.hpp"

namespace umbel::kdtree {
namespace {

typedef uint8_t Byte4 __attribute__((vector_size(4)));

/// From coordinates to intervals: first one face of the cell, then the bins, and last the other
/// face.
class Scale {
 public:
  Scale(const Aabb& cell, uint32_t bins) : last_(splat(static_cast<float>(bins - 1))) {
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const float least = component(cell.min, axis), most = component(cell.max, axis);
      least_[axis] = least;
      most_[axis] = most;
      factor_[axis] = can_divide(least, most) ? static_cast<float>(bins / extent(least, most)) : 0;
    }
  }

  /// Whether bins are as wide as each other, which they are not where floats come to their ends.
  static bool can_divide(float least, float most) {
    return extent(least, most) > 0x1p-100 && extent(least, most) < 0x1p126;
  }

  Byte4 intervals_of(Float4 at) const {
    const Float4 bin = min4((at - least_) * factor_, last_);
    // Comparisons give 0 or -1.
    const Int4 interval = __builtin_convertvector(bin, Int4) - (at > least_) - (at >= most_);
    return __builtin_convertvector(interval, Byte4);
  }

 private:
  static double extent(float least, float most) { return double(most) - double(least); }
  Float4 least_{}, most_{}, factor_{}, last_;
};

void sort_few(std::vector<float>& values) {
  if (values.size() > 32) {
    std::sort(values.begin(), values.end());
    return;
  }
  for (size_t i = 1; i < values.size(); ++i) {
    const float value = values[i];
    size_t k = i;
    for (; k > 0 && values[k - 1] > value; --k) values[k] = values[k - 1];
    values[k] = value;
  }
}

}  // namespace

void BoxGrower::push(uint32_t triangle, const Aabb& box) {
  items_.push_back({Float4{box.min.x, box.min.y, box.min.z, 0},
                    Float4{box.max.x, box.max.y, box.max.z, 0}, triangle});
}

double BoxGrower::grow(const Span& span, const Aabb& cell, const Allowance& left, Subtree& out) {
  if (span.count <= SmallSet::kMost) return grow_small(span, cell, left, out);
  const size_t node = out.nodes.size(), reference = out.references.size();
  const double as_leaf = rule_.leaf(span.count);
  const Split plane = best_split(span, cell);
  bool is_bad = false;
  Span below, above;
  if (!is_worth(rule_, plane, span.count, left, is_bad) ||
      !split(span, cell, plane, left.spare, below, above)) {
    std::vector<uint32_t> triangles(span.count);
    for (uint32_t i = 0; i < span.count; ++i) triangles[i] = items_[span.first + i].triangle;
    add_leaf(triangles, out);
    return as_leaf;
  }
  const auto [first, second] = shares(left, span.count, is_bad, below.count, above.count);
  const Aabb low = cell_below(cell, plane), high = cell_above(cell, plane);
  out.nodes.emplace_back();
  const double cost_below = grow(below, low, first, out);
  const auto middle = static_cast<uint32_t>(out.nodes.size());
  // What lay here is not needed any more.
  std::copy_n(items_.begin() + above.first, above.count, items_.begin() + span.first);
  const double cost_above = grow({span.first, above.count, span.top}, high, second, out);
  out.nodes[node] = Node::inner(plane.axis, plane.at, middle);
  const double cost =
      rule_.traversal +
      (rule_.area(low) * cost_below + rule_.area(high) * cost_above) / rule_.area(cell);
  if (cost < as_leaf) return cost;
  join_leaves(node, reference, out);
  return as_leaf;
}

double BoxGrower::grow_small(const Span& span, const Aabb& cell, const Allowance& left,
                             Subtree& out) const {
  SmallSet small(primitives_);
  for (uint32_t i = 0; i < span.count; ++i) {
    const Item& item = items_[span.first + i];
    small.push(item.triangle, item.box());
  }
  return small.grow(rule_, cell, left, out);
}

Split BoxGrower::best_split(const Span& span, const Aabb& cell) {
  constexpr uint32_t kEnds = 4;  // in an interval
  const uint32_t bins = std::clamp(span.count / kEnds, 8u, kMostBins);
  count(span, cell, bins);
  intervals_.clear();
  Split best;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    if (!(component(cell.min, axis) < component(cell.max, axis))) continue;
    const PlaneCost cost(rule_, cell, axis);
    const uint32_t at_low = ends_[axis][0], at_high = begins_[axis][bins + 1];
    cost.consider(cost.low(), 0, at_low, span.count - at_low, best);
    cost.consider(cost.high(), span.count - at_high, at_high, 0, best);
    list_intervals(cost, span.count, bins);
  }
  if (intervals_.empty()) return best;
  const auto look_into = [&](const Interval& interval) {
    sweep(PlaneCost(rule_, cell, interval.axis), span, interval, best);
  };
  const Interval first = *std::min_element(intervals_.begin(), intervals_.end());
  look_into(first);
  std::erase_if(intervals_, [&](const Interval& s) {
    return s.bound > best.cost || (s.axis == first.axis && s.number == first.number);
  });
  std::sort(intervals_.begin(), intervals_.end());
  for (const Interval& interval : intervals_) {
    if (interval.bound > best.cost) break;
    look_into(interval);
  }
  return best;
}

void BoxGrower::count(const Span& span, const Aabb& cell, uint32_t bins) {
  for (uint32_t axis = 0; axis < 3; ++axis) {
    std::fill_n(begins_[axis], bins + 2, 0u);
    std::fill_n(ends_[axis], bins + 2, 0u);
  }
  if (intervals_of_.size() < span.count) intervals_of_.resize(span.count);
  const Scale scale(cell, bins);
  for (uint32_t i = 0; i < span.count; ++i) {
    const Item& item = items_[span.first + i];
    const uint64_t low = std::bit_cast<uint32_t>(scale.intervals_of(item.low)),
                   high = std::bit_cast<uint32_t>(scale.intervals_of(item.high));
    intervals_of_[i] = high << 32 | low;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      ++begins_[axis][low >> (8 * axis) & 255];
      ++ends_[axis][high >> (8 * axis) & 255];
    }
  }
}

void BoxGrower::list_intervals(const PlaneCost& cost, uint32_t count, uint32_t bins) {
  const uint32_t axis = cost.axis();
  const bool is_even = Scale::can_divide(cost.low(), cost.high());
  uint32_t before = begins_[axis][0], after = count - ends_[axis][0];
  for (uint32_t interval = 1; interval <= bins; ++interval) {
    after -= ends_[axis][interval];
    if ((begins_[axis][interval] | ends_[axis][interval]) != 0) {
      const double from = double(interval - 1) / bins, to = double(interval) / bins;
      const double bound = is_even ? cost.bound(from, to, before, after) : 0;
      intervals_.push_back({bound, axis, interval, before, after});
    }
    before += begins_[axis][interval];
  }
}

void BoxGrower::gather(const Span& span, uint32_t axis, uint32_t interval) {
  lows_.clear();
  highs_.clear();
  flats_.clear();
  for (uint32_t i = 0; i < span.count; ++i) {
    const uint64_t intervals = intervals_of_[i] >> (8 * axis);
    const bool begins = (intervals & 255) == interval, ends = (intervals >> 32 & 255) == interval;
    if (!(begins | ends)) continue;
    const Item& item = items_[span.first + i];
    const float low = item.low[axis], high = item.high[axis];
    if (low == high) {
      flats_.push_back(low);
      continue;
    }
    if (begins) lows_.push_back(low);
    if (ends) highs_.push_back(high);
  }
  sort_few(lows_);
  sort_few(highs_);
  sort_few(flats_);
}

void BoxGrower::sweep(const PlaneCost& cost, const Span& span, const Interval& interval,
                      Split& best) {
  gather(span, interval.axis, interval.number);
  size_t i = 0, j = 0, k = 0;
  const auto at = [](const std::vector<float>& ends, size_t n) {
    return n < ends.size() ? ends[n] : kInfinity;
  };
  float low = at(lows_, 0), high = at(highs_, 0), flat = at(flats_, 0);
  while (true) {
    const float plane = std::min(std::min(low, high), flat);
    if (plane == kInfinity) return;
    const size_t below = interval.before + i + k, first_flat = k;
    while (high == plane) high = at(highs_, ++j);
    while (flat == plane) flat = at(flats_, ++k);
    cost.consider(plane, below, k - first_flat,
                  interval.after + highs_.size() - j + flats_.size() - k, best);
    while (low == plane) low = at(lows_, ++i);
  }
}

/// What lies below the plane stays where it is, what lies above goes behind all that are needed.
bool BoxGrower::split(const Span& span, const Aabb& cell, const Split& split, uint64_t spare,
                      Span& below, Span& above) {
  const uint32_t axis = split.axis, end = span.first + span.count;
  if (spare < span.count) {
    const auto split_count = std::count_if(
        items_.begin() + span.first, items_.begin() + end,
        [&](const Item& item) { return item.low[axis] < split.at && item.high[axis] > split.at; });
    if (static_cast<uint64_t>(split_count) > spare) return false;
  }
  if (items_.size() < size_t{span.top} + span.count)
    items_.resize(std::max(size_t{span.top} + span.count, 2 * items_.size()));
  Item *next_below = items_.data() + span.first, *next_above = items_.data() + span.top;
  const auto keep = [](Item*& next, const Aabb& box, uint32_t triangle) {
    if (is_empty(box)) return;
    *next++ = {Float4{box.min.x, box.min.y, box.min.z, 0},
               Float4{box.max.x, box.max.y, box.max.z, 0}, triangle};
  };
  for (uint32_t i = span.first; i < end; ++i) {
    const Item item = items_[i];
    const float low = item.low[axis], high = item.high[axis];
    const bool is_flat = low == high && low == split.at;
    if (is_flat ? split.flat_below : high <= split.at) {
      *next_below++ = item;
    } else if (is_flat || low >= split.at) {
      *next_above++ = item;
    } else {
      const Halves halves = primitives_.halves(item.triangle, cell, split);
      keep(next_below, halves.below, item.triangle);
      keep(next_above, halves.above, item.triangle);
    }
  }
  const auto count_above = static_cast<uint32_t>(next_above - items_.data()) - span.top;
  below = {span.first, static_cast<uint32_t>(next_below - items_.data()) - span.first,
           span.top + count_above};
  above = {span.top, count_above, 0};
  return true;
}

}  // namespace umbel::kdtree
