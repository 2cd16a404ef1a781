// The triangles of a cell with their boxes' ends in sorted order on every axis, as Wald & Havran,
// "On building fast kd-Trees for Ray Tracing, and on doing that in O(N log N)" (2006) keep them:
// sorted once, at the root; a split filters the lists, and only the new ends of triangles that the
// plane splits are sorted and merged in. Starts, ends and planar events have lists of their own, so
// counts are positions in lists.
//
// A sweep over all events is not needed to find the best plane: counts at a few planes bound from
// below what any plane between them may cost, and only where that bound beats the best so far are
// events looked at one by one. What is found is what a whole sweep finds.
#pragma once

#include <array>
#include <span>

#include "base/cpu_buffer.hpp"
#include "kdtree/box_grower.hpp"
#include "kdtree/clip.hpp"

namespace umbel::kdtree {

/// Where the box of a triangle begins or ends on an axis, or both.
struct Event {
  float at;
  uint32_t id;  ///< within its set
};

/// The events of one kind on one axis, in ascending order.
struct EventList {
  Event* events = nullptr;
  uint32_t size = 0;
  const Event* begin() const { return events; }
  const Event* end() const { return events + size; }
};

class EventSet {
 public:
  EventSet() = default;
  /// The triangles `numbers` of a mesh, whose boxes these are.
  EventSet(const Primitives& primitives, const CostRule& rule, std::span<const uint32_t> numbers,
           std::span<const Aabb> boxes);

  uint32_t size() const { return count_; }
  bool is_small() const { return count_ <= BoxGrower::kMost; }
  std::span<const uint32_t> triangles() const { return {triangles_.data(), count_}; }
  Split best_split(const Aabb& cell) const;
  bool split(const Aabb& cell, const Split& split, uint64_t spare, EventSet& below,
             EventSet& above) const;
  double grow_small(const CostRule& rule, const Aabb& cell, const Allowance& left,
                    Subtree& out) const;

 private:
  enum Kind : uint32_t { kLow, kHigh, kFlat };
  struct Division;

  void allocate(const Primitives& primitives, const CostRule& rule, uint32_t count,
                const std::array<uint32_t, 3>& flats);
  EventList& list(uint32_t axis, Kind kind) { return lists_[3 * axis + kind]; }
  const EventList& list(uint32_t axis, Kind kind) const { return lists_[3 * axis + kind]; }
  void sort_ends(uint32_t axis, Kind kind, std::span<const Aabb> boxes);
  void search_axis(const PlaneCost& cost, Split& best) const;
  void sweep(const PlaneCost& cost, float from, float to, Split& best) const;
  void assign(const Split& split, Division& division) const;
  void filter(uint32_t axis, Kind kind, const Division& division, EventSet& below,
              EventSet& above) const;

  const Primitives* primitives_ = nullptr;
  const CostRule* rule_ = nullptr;
  uint32_t count_ = 0;
  CpuBuffer<uint32_t> triangles_;
  CpuBuffer<Event> events_;
  std::array<EventList, 9> lists_;
};

}  // namespace umbel::kdtree
