// The best cut within a budget, without trying cuts: a cluster is in the cuts of a range of
// errors, or of thresholds, and sorting the ends of those ranges gives the cost of every cut.
#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>

#include "base/parallel.hpp"
#include "lod/select/instances.hpp"
#include "lod/select/turning_point.hpp"

namespace umbel::lod {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// One instance, and what turns the scene's errors or thresholds into its own.
struct Seen {
  View view;
  std::vector<Plane> planes;
  double factor;
};

struct Event {
  float at;
  int64_t cost;
};

void append_events(const Tables& tables, std::span<const uint32_t> costs, const Seen& seen,
                   std::span<const ClusterBounds> normal_cones, std::vector<Event>& events) {
  const Culling culling{seen.planes, normal_cones};
  std::vector<float> turns(tables.groups.size());
  parallel_for(turns.size(), 1024, [&](size_t g) {
    const Group& group = tables.groups[g];
    turns[g] = turning_point(group.sphere, group.error, seen.view, seen.factor);
  });
  for (const Group& group : tables.groups) {
    if (is_outside(group.sphere, culling.planes)) continue;
    for (uint32_t c = group.clusters.offset; c < group.clusters.offset + group.clusters.count;
         ++c) {
      const Cluster& cluster = tables.clusters[c];
      const float enters =
          cluster.generating_group == kNone ? 0.0f : turns[cluster.generating_group];
      const float leaves = turns[cluster.group];
      if (!(enters < leaves) || !is_visible(tables, c, seen.view, culling)) continue;
      events.push_back({enters, costs[c]});
      if (leaves < kInfinity) events.push_back({leaves, -int64_t{costs[c]}});
    }
  }
}

// The smallest value, at least `least`, at which the sum of all events up to it fits.
float first_that_fits(std::vector<Event>& events, float least, uint64_t budget) {
  std::sort(events.begin(), events.end(),
            [](const Event& a, const Event& b) { return a.at < b.at; });
  const int64_t most = static_cast<int64_t>(std::min<uint64_t>(budget, INT64_MAX));
  int64_t cost = 0;
  size_t i = 0;
  float value = least;
  for (;; value = events[i].at) {
    for (; i < events.size() && events[i].at <= value; ++i) cost += events[i].cost;
    if (cost <= most || i == events.size()) return value;
  }
}

Seen see(const View& view, const Culling& culling, const Transform& transform) {
  const Stretch s = stretch(transform);
  return {to_object(view, transform), to_object(culling.planes, transform),
          view.kind == View::Kind::kError ? 1 / s.most : s.least / s.most};
}

}  // namespace

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

View view_for_budget(const Tables& tables, const View& view, std::span<const uint32_t> costs,
                     uint64_t budget, const Culling& culling,
                     std::span<const Transform> instances) {
  check(tables, view, culling);
  if (view.kind == View::Kind::kLevel)
    throw Error(ErrorCode::kInvalidArgument,
                "view_for_budget needs a view by error or by camera: levels are whole");
  if (costs.size() != tables.clusters.size())
    throw Error(ErrorCode::kInvalidArgument,
                "view_for_budget: there are " + std::to_string(costs.size()) + " costs for " +
                    std::to_string(tables.clusters.size()) + " clusters");
  std::vector<Event> events;
  if (instances.empty()) {
    const Seen seen{view, {culling.planes.begin(), culling.planes.end()}, 1.0};
    append_events(tables, costs, seen, culling.normal_cones, events);
  }
  for (const Transform& transform : instances)
    append_events(tables, costs, see(view, culling, transform), culling.normal_cones, events);
  View result = view;
  float& value = view.kind == View::Kind::kError ? result.error : result.threshold;
  value = first_that_fits(events, value, budget);
  return result;
}

float error_for_triangles(const Tables& tables, uint64_t max_triangles) {
  return view_for_budget(tables, view_error(0), triangle_costs(tables), max_triangles).error;
}

}  // namespace umbel::lod
