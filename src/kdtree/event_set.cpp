#include "kdtree/event_set.hpp"

#include <algorithm>
#include <bit>
#include <vector>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/radix_sort.hpp"
#include "base/radix_sort_pairs.hpp"

namespace umbel::kdtree {
namespace {

/// Sets larger than this are divided by several tasks.
constexpr uint32_t kParallelEvents = 1u << 14;

// Where a triangle goes: its number in the set below, or in the set above with kAbove.
constexpr uint32_t kAbove = 0x80000000u, kBoth = 0x40000000u;

float key_to_float(uint32_t key) {
  return std::bit_cast<float>(key & 0x80000000u ? key & 0x7fffffffu : ~key);
}

bool precedes(const Event& a, const Event& b) { return a.at != b.at ? a.at < b.at : a.id < b.id; }

uint32_t events_before(const EventList& list, float at) {
  return static_cast<uint32_t>(std::lower_bound(list.begin(), list.end(), at,
                                                [](const Event& e, float x) { return e.at < x; }) -
                               list.begin());
}

uint32_t events_after(const EventList& list, float at) {
  return static_cast<uint32_t>(list.end() -
                               std::upper_bound(list.begin(), list.end(), at,
                                                [](float x, const Event& e) { return x < e.at; }));
}

/// Adds sorted events to a list whose own ones lie behind a gap of just that size.
void merge(EventList& list, std::span<const Event> added) {
  const Event *own = list.events + added.size(), *end = own + list.size;
  Event* out = list.events;
  for (const Event& event : added) {
    while (own != end && own->at <= event.at) *out++ = *own++;
    *out++ = event;
  }
  list.size += static_cast<uint32_t>(added.size());
}

}  // namespace

/// Which triangle goes where. Those that the plane splits come last in both sets.
struct EventSet::Division {
  CpuBuffer<uint32_t> target;   ///< of each triangle; kBoth for those that are split
  std::vector<uint32_t> split;  ///< their numbers
  std::vector<Halves> halves;
  uint32_t whole_below = 0, whole_above = 0;
  uint32_t below = 0, above = 0;  ///< all

  /// The ends of the split triangles' boxes on one side, sorted.
  std::vector<Event> events(bool is_above, uint32_t axis, Kind kind) const {
    std::vector<Event> found;
    uint32_t id = is_above ? whole_above : whole_below;
    for (const Halves& h : halves) {
      const Aabb& box = is_above ? h.above : h.below;
      if (is_empty(box)) continue;
      const float low = component(box.min, axis), high = component(box.max, axis);
      if ((low == high) == (kind == kFlat)) found.push_back({kind == kHigh ? high : low, id});
      ++id;
    }
    std::sort(found.begin(), found.end(), precedes);
    return found;
  }
};

EventSet::EventSet(const Primitives& primitives, const CostRule& rule,
                   std::span<const uint32_t> numbers, std::span<const Aabb> boxes) {
  const auto count = static_cast<uint32_t>(boxes.size());
  std::array<uint32_t, 3> flats{};
  for (const Aabb& box : boxes)
    for (uint32_t axis = 0; axis < 3; ++axis)
      flats[axis] += component(box.min, axis) == component(box.max, axis);
  allocate(primitives, rule, count, flats);
  std::copy(numbers.begin(), numbers.end(), triangles_.data());
  parallel_for(6, 1, [&](size_t i) {
    sort_ends(static_cast<uint32_t>(i / 2), i % 2 == 0 ? kLow : kHigh, boxes);
  });
}

void EventSet::allocate(const Primitives& primitives, const CostRule& rule, uint32_t count,
                        const std::array<uint32_t, 3>& flats) {
  primitives_ = &primitives;
  rule_ = &rule;
  count_ = count;
  triangles_ = CpuBuffer<uint32_t>(count);
  // One event more than there are in each list: filter() writes first and counts later.
  size_t total = 0;
  for (const uint32_t flat : flats) total += 2 * (size_t{count} + 1) + flat + 1;
  events_ = CpuBuffer<Event>(total);
  Event* next = events_.data();
  for (uint32_t axis = 0; axis < 3; ++axis) {
    list(axis, kLow) = {next, 0};
    list(axis, kHigh) = {next + count + 1, 0};
    list(axis, kFlat) = {next + 2 * (size_t{count} + 1), 0};
    next += 2 * (size_t{count} + 1) + flats[axis] + 1;
  }
}

/// Planar events are listed with the low ends.
void EventSet::sort_ends(uint32_t axis, Kind kind, std::span<const Aabb> boxes) {
  const uint32_t count = count_;
  const CpuBuffer<uint32_t> keys(count), ids(count);
  const CpuBuffer<KeyAndValue<uint32_t>> spare(count);
  parallel_for(count, 4096, [&](size_t i) {
    const Vec3& end = kind == kLow ? boxes[i].min : boxes[i].max;
    keys[i] = float_to_key(component(end, axis));
    ids[i] = static_cast<uint32_t>(i);
  });
  radix_sort_pairs(count, keys.data(), ids.data(), 0, 32, spare.data());
  EventList &own = list(axis, kind), &flat = list(axis, kFlat);
  for (uint32_t i = 0; i < count; ++i) {
    const Event event{key_to_float(keys[i]), ids[i]};
    const Aabb& box = boxes[ids[i]];
    if (component(box.min, axis) != component(box.max, axis))
      own.events[own.size++] = event;
    else if (kind == kLow)
      flat.events[flat.size++] = event;
  }
}

Split EventSet::best_split(const Aabb& cell) const {
  Split best;
  for (uint32_t axis = 0; axis < 3; ++axis)
    if (component(cell.min, axis) < component(cell.max, axis))
      search_axis(PlaneCost(*rule_, cell, axis), best);
  return best;
}

void EventSet::search_axis(const PlaneCost& cost, Split& best) const {
  constexpr uint32_t kSweepAll = 192, kEvents = 32, kMostStretches = 1024;
  if (count_ < kSweepAll) return sweep(cost, cost.low(), cost.high(), best);
  const EventList &low = list(cost.axis(), kLow), &high = list(cost.axis(), kHigh),
                  &flat = list(cost.axis(), kFlat);
  const EventList& longer = low.size >= flat.size ? low : flat;
  struct Stretch {
    double bound;
    float from, to;
  };
  const uint32_t stretches = std::min(longer.size / kEvents, kMostStretches) + 1;
  std::vector<Stretch> all;
  all.reserve(stretches + 1);
  float from = cost.low();
  for (uint32_t i = 1; i <= stretches; ++i) {
    const size_t at = size_t{i} * longer.size / stretches;
    const float to = i == stretches ? cost.high() : longer.events[at].at;
    if (to == from && i < stretches) continue;
    const uint32_t below = events_before(low, from) + events_before(flat, from);
    const uint32_t above = events_after(high, to) + events_after(flat, to);
    all.push_back({std::min(cost(from, below, above), cost(to, below, above)), from, to});
    from = to;
  }
  std::sort(all.begin(), all.end(), [](const Stretch& a, const Stretch& b) {
    return a.bound != b.bound ? a.bound < b.bound : a.from < b.from;
  });
  for (const Stretch& s : all) {
    if (s.bound > best.cost) break;
    sweep(cost, s.from, s.to, best);
  }
}

void EventSet::sweep(const PlaneCost& cost, float from, float to, Split& best) const {
  const EventList &low = list(cost.axis(), kLow), &high = list(cost.axis(), kHigh),
                  &flat = list(cost.axis(), kFlat);
  uint32_t i = events_before(low, from), j = events_before(high, from),
           k = events_before(flat, from);
  const auto at = [&](const EventList& list, uint32_t n) {
    return n < list.size ? list.events[n].at : kInfinity;
  };
  float next_low = at(low, i), next_high = at(high, j), next_flat = at(flat, k);
  while (true) {
    const float plane = std::min(std::min(next_low, next_high), next_flat);
    if (!(plane <= to) || plane == kInfinity) return;
    const uint32_t below = i + k;
    while (next_high == plane) next_high = at(high, ++j);
    const uint32_t first_flat = k;
    while (next_flat == plane) next_flat = at(flat, ++k);
    cost.consider(plane, below, k - first_flat, high.size - j + flat.size - k, best);
    while (next_low == plane) next_low = at(low, ++i);
  }
}

void EventSet::assign(const Split& split, Division& division) const {
  uint32_t* const target = division.target.data();
  std::fill_n(target, count_, kBoth);
  const EventList &low = list(split.axis, kLow), &high = list(split.axis, kHigh),
                  &flat = list(split.axis, kFlat);
  for (const Event* e = low.begin() + events_before(low, split.at); e != low.end(); ++e)
    target[e->id] = kAbove;
  for (const Event* e = high.begin(); e != high.end() && e->at <= split.at; ++e) target[e->id] = 0;
  for (const Event& e : flat)
    target[e.id] = e.at < split.at || (e.at == split.at && split.flat_below) ? 0 : kAbove;
  uint32_t below = 0, above = 0;
  for (uint32_t id = 0; id < count_; ++id) {
    const uint32_t side = target[id];
    if (side == kBoth) {
      division.split.push_back(id);
      continue;
    }
    target[id] = side | (side ? above : below);
    above += side >> 31;
    below += 1 - (side >> 31);
  }
  division.whole_below = below;
  division.whole_above = above;
}

bool EventSet::split(const Aabb& cell, const Split& split, uint64_t spare, EventSet& below,
                     EventSet& above) const {
  Division division;
  division.target = CpuBuffer<uint32_t>(count_);
  assign(split, division);
  if (division.split.size() > spare) return false;
  division.halves.resize(division.split.size());
  parallel_for(division.split.size(), 512, [&](size_t i) {
    division.halves[i] = primitives_->halves(triangles_[division.split[i]], cell, split);
  });
  division.below = division.whole_below;
  division.above = division.whole_above;
  for (const Halves& h : division.halves) {
    division.below += !is_empty(h.below);
    division.above += !is_empty(h.above);
  }
  std::array<uint32_t, 3> flats_below, flats_above;
  const auto added = static_cast<uint32_t>(division.split.size());
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const uint32_t most = list(axis, kFlat).size + added;
    flats_below[axis] = std::min(most, division.below);
    flats_above[axis] = std::min(most, division.above);
  }
  below.allocate(*primitives_, *rule_, division.below, flats_below);
  above.allocate(*primitives_, *rule_, division.above, flats_above);
  const auto filter_list = [&](size_t i) {
    filter(static_cast<uint32_t>(i / 3), static_cast<Kind>(i % 3), division, below, above);
  };
  if (count_ < kParallelEvents)
    for (size_t i = 0; i < 9; ++i) filter_list(i);
  else
    parallel_for(9, 1, filter_list);
  for (uint32_t id = 0; id < count_; ++id) {
    const uint32_t target = division.target[id];
    if (target >= kAbove)
      above.triangles_[target - kAbove] = triangles_[id];
    else if (target != kBoth)
      below.triangles_[target] = triangles_[id];
  }
  uint32_t next_below = division.whole_below, next_above = division.whole_above;
  for (uint32_t i = 0; i < added; ++i) {
    if (!is_empty(division.halves[i].below))
      below.triangles_[next_below++] = triangles_[division.split[i]];
    if (!is_empty(division.halves[i].above))
      above.triangles_[next_above++] = triangles_[division.split[i]];
  }
  return true;
}

void EventSet::filter(uint32_t axis, Kind kind, const Division& division, EventSet& below,
                      EventSet& above) const {
  const std::vector<Event> added_below = division.events(false, axis, kind);
  const std::vector<Event> added_above = division.events(true, axis, kind);
  EventList &low = below.list(axis, kind), &high = above.list(axis, kind);
  Event* const out_below = low.events + added_below.size();
  Event* const out_above = high.events + added_above.size();
  const uint32_t* const target = division.target.data();
  uint32_t count_below = 0, count_above = 0;
  for (const Event& event : list(axis, kind)) {
    const uint32_t to = target[event.id];
    out_below[count_below] = {event.at, to};
    out_above[count_above] = {event.at, to & ~kAbove};
    count_below += to < kBoth;
    count_above += to >> 31;
  }
  low.size = count_below;
  high.size = count_above;
  merge(low, added_below);
  merge(high, added_above);
}

double EventSet::grow_small(const CostRule& rule, const Aabb& cell, const Allowance& left,
                            Subtree& out) const {
  std::vector<Aabb> boxes(count_);
  for (uint32_t axis = 0; axis < 3; ++axis) {
    for (const Event& e : list(axis, kLow)) component(boxes[e.id].min, axis) = e.at;
    for (const Event& e : list(axis, kHigh)) component(boxes[e.id].max, axis) = e.at;
    for (const Event& e : list(axis, kFlat))
      component(boxes[e.id].min, axis) = component(boxes[e.id].max, axis) = e.at;
  }
  BoxGrower grower(*primitives_, rule);
  for (uint32_t i = 0; i < count_; ++i) grower.push(triangles_[i], boxes[i]);
  return grower.grow(cell, left, out);
}

}  // namespace umbel::kdtree
