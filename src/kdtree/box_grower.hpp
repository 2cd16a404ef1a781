// Subtrees of a few thousand triangles, held as boxes. No events are kept: the ends of boxes are
// counted into slots along each axis, the counts bound from below what any plane in a slot may
// cost, and only where that bound beats the best plane so far are the ends in the slot sorted and
// looked at one by one. What is found is what a sweep over all events finds.
#pragma once

#include <vector>

#include "base/simd/box4.hpp"
#include "kdtree/small_set.hpp"

namespace umbel::kdtree {

class BoxGrower {
 public:
  /// With more boxes than this, events that stay sorted are faster.
  static constexpr uint32_t kMost = 1u << 12;

  BoxGrower(const MeshView& mesh, const CostRule& rule) : mesh_(mesh), rule_(rule) {}

  void push(uint32_t triangle, const Aabb& box);

  /// Of all that was pushed. Expects `left` as Grower does. Returns the expected cost of a line
  /// through the cell.
  double grow(const Aabb& cell, const Allowance& left, Subtree& out) {
    const auto count = static_cast<uint32_t>(items_.size());
    return grow({0, count, count}, cell, left, out);
  }

 private:
  using Float4 = bvh::Float4;
  using Int4 = bvh::Int4;
  static constexpr uint32_t kMostBins = 128, kMostSlots = kMostBins + 2;

  struct Item {
    Float4 low, high;  ///< lane 3 is zero
    uint32_t triangle;
    Aabb box() const { return {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}}; }
  };
  /// Some items, and where the room behind all that are needed begins.
  struct Span {
    uint32_t first, count, top;
  };
  /// A slot in which the best plane may lie, and how many triangles begin before and end after it.
  struct Slot {
    double bound;
    uint32_t axis, number, before, after;
    bool operator<(const Slot& o) const {
      if (bound != o.bound) return bound < o.bound;
      return axis != o.axis ? axis < o.axis : number < o.number;
    }
  };

  double grow(const Span& span, const Aabb& cell, const Allowance& left, Subtree& out);
  double grow_small(const Span& span, const Aabb& cell, const Allowance& left, Subtree& out) const;
  Split best_split(const Span& span, const Aabb& cell);
  void count(const Span& span, const Aabb& cell, uint32_t bins);
  void list_slots(const PlaneCost& cost, uint32_t count, uint32_t bins);
  void sweep(const PlaneCost& cost, const Span& span, const Slot& slot, Split& best);
  void gather(const Span& span, uint32_t axis, uint32_t slot);
  bool split(const Span& span, const Aabb& cell, const Split& split, uint64_t spare, Span& below,
             Span& above);

  const MeshView& mesh_;
  const CostRule& rule_;
  std::vector<Item> items_;
  uint32_t begins_[3][kMostSlots], ends_[3][kMostSlots];
  std::vector<uint64_t> slots_of_;  ///< of each box a byte an end: low x, y, z, -, high x, y, z, -
  std::vector<Slot> slots_;
  std::vector<float> lows_, highs_, flats_;  ///< the ends in a slot
};

}  // namespace umbel::kdtree
