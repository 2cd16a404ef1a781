// The best cut within a budget, without trying cuts: a cluster is in the cuts of a range of
// errors, or of thresholds, and sorting the ends of those ranges gives the cost of every cut.
#include "lod/select/budget.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "lod/select/instances.hpp"
#include "lod/select/turning_point.hpp"

namespace umbel::lod {
namespace {}  // namespace

float turning_point(const Group& group, const Seen& seen) {
  return turning_point(group.sphere, group.error, seen.view, seen.factor);
}

namespace {

struct Event {
  float at;
  int64_t cost;
};

// From where on a cluster is in the cut, and up to where.
struct Stay {
  float enters, leaves;
};

void append(const Stay& stay, uint32_t cost, std::vector<Event>& events) {
  if (cost == 0 || !(stay.enters < stay.leaves)) return;
  events.push_back({stay.enters, cost});
  if (stay.leaves < kInfinity) events.push_back({stay.leaves, -int64_t{cost}});
}

void append_events(const Tables& tables, const Costs& costs, const Seen& seen,
                   std::span<const ClusterBounds> normal_cones, std::vector<Event>& events) {
  const Culling culling{seen.planes, normal_cones};
  std::vector<float> turns(tables.groups.size());
  parallel_for(turns.size(), 1024,
               [&](size_t g) { turns[g] = turning_point(tables.groups[g], seen); });
  for (size_t g = 0; g < turns.size(); ++g) {
    const Group& group = tables.groups[g];
    if (is_outside(group.sphere, culling.planes)) continue;
    Stay first{kInfinity, turns[g]};  // of the group: as soon as one of its clusters
    for (uint32_t c = group.clusters.offset; c < group.clusters.offset + group.clusters.count;
         ++c) {
      const uint32_t generating = tables.clusters[c].generating_group;
      const Stay stay{generating == kNone ? 0.0f : turns[generating], turns[g]};
      if (!(stay.enters < stay.leaves) || !is_visible(tables, c, seen.view, culling)) continue;
      first.enters = std::min(first.enters, stay.enters);
      if (!costs.clusters.empty()) append(stay, costs.clusters[c], events);
    }
    if (!costs.groups.empty()) append(first, costs.groups[g], events);
  }
}

struct Fit {
  float value;
  bool fits;
};

// The smallest value, at least `least`, at which the sum of all events up to it fits; the last
// where none does.
Fit first_that_fits(std::vector<Event>& events, float least, uint64_t budget) {
  std::sort(events.begin(), events.end(),
            [](const Event& a, const Event& b) { return a.at < b.at; });
  const int64_t most = static_cast<int64_t>(std::min<uint64_t>(budget, INT64_MAX));
  int64_t cost = 0;
  size_t i = 0;
  float value = least;
  for (;; value = events[i].at) {
    for (; i < events.size() && events[i].at <= value; ++i) cost += events[i].cost;
    if (cost <= most || i == events.size()) return {value, cost <= most};
  }
}

void check_length(size_t given, size_t needed, const char* of) {
  if (given == 0 || given == needed) return;
  throw Error(ErrorCode::kInvalidArgument, "view_for_budget: there are " + std::to_string(given) +
                                               " costs for " + std::to_string(needed) + " " + of);
}

}  // namespace

Seen see(const View& view, const Culling& culling) {
  return {view, {culling.planes.begin(), culling.planes.end()}, 1.0};
}

Seen see(const View& view, const Culling& culling, const Transform& transform) {
  const Stretch s = stretch(transform);
  return {to_object(view, transform), to_object(culling.planes, transform),
          view.kind == View::Kind::kError ? 1 / s.most : s.least / s.most};
}

void check_budget(const Tables& tables, const View& view, const Costs& costs,
                  const Culling& culling) {
  check(tables, view, culling);
  if (view.kind == View::Kind::kLevel)
    throw Error(ErrorCode::kInvalidArgument,
                "a budget needs a view by error or by camera: levels are whole");
  check_length(costs.clusters.size(), tables.clusters.size(), "clusters");
  check_length(costs.groups.size(), tables.groups.size(), "groups");
}

std::vector<uint32_t> triangle_costs(const Tables& tables) {
  std::vector<uint32_t> costs;
  costs.reserve(tables.clusters.size());
  for (const Cluster& cluster : tables.clusters) costs.push_back(cluster.triangle_count);
  return costs;
}

std::vector<uint32_t> byte_costs(const Tables& tables, uint32_t vertex_bytes,
                                 uint32_t triangle_bytes) {
  std::vector<uint32_t> costs;
  costs.reserve(tables.clusters.size());
  for (const Cluster& cluster : tables.clusters) {
    const uint64_t cost = uint64_t{cluster.vertex_count} * vertex_bytes +
                          uint64_t{cluster.triangle_count} * triangle_bytes;
    if (cost > kNone)
      throw Error(ErrorCode::kInvalidArgument,
                  "byte_costs: " + std::to_string(vertex_bytes) + " bytes a vertex and " +
                      std::to_string(triangle_bytes) + " a triangle make a cluster of over 2^32");
    costs.push_back(static_cast<uint32_t>(cost));
  }
  return costs;
}

View view_for_budget(const Tables& tables, const View& view, const Costs& costs, uint64_t budget,
                     const Culling& culling, std::span<const Transform> instances) {
  check_budget(tables, view, costs, culling);
  std::vector<Event> events;
  if (instances.empty())
    append_events(tables, costs, see(view, culling), culling.normal_cones, events);
  for (size_t i = 0; i < instances.size(); ++i) {
    const Seen seen = of_instance(i, [&] { return see(view, culling, instances[i]); });
    append_events(tables, costs, seen, culling.normal_cones, events);
  }
  View result = view;
  float& value = view.kind == View::Kind::kError ? result.error : result.threshold;
  const Fit found = first_that_fits(events, value, budget);
  value = found.value;
  // No threshold is large enough for groups around the eye.
  return found.fits || view.kind == View::Kind::kError ? result : view_error(kInfinity);
}

float error_for_triangles(const Tables& tables, uint64_t max_triangles) {
  return view_for_budget(tables, view_error(0), triangle_costs(tables), max_triangles).error;
}

}  // namespace umbel::lod
