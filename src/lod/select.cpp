// Selection of a cut by tests that are independent of each other (Karis, "Nanite: A Deep Dive",
// 2021): a cluster is in the cut if its group must be refined and the group that it was made
// from need not be. Errors and spheres never shrink from a generating group to the groups of
// what it generated, so along every path through the DAG exactly one cluster answers yes.
#include <numeric>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "lod/hierarchy.hpp"
#include "lod/refine.hpp"
#include "umbel/lod.hpp"

namespace umbel::lod {
namespace {

constexpr size_t kChunk = 1 << 14;

void check(const View& view) {
  const char* wrong = nullptr;
  switch (view.kind) {
    case View::Kind::kError:
      if (!(view.error >= 0)) wrong = "View::error must be at least 0";
      break;
    case View::Kind::kCamera:
      if (!(view.threshold >= 0)) wrong = "View::threshold must be at least 0";
      if (!is_finite(view.eye)) wrong = "View::eye must be finite";
      break;
    case View::Kind::kLevel:
      break;
    default:
      wrong = "View::kind must be kError, kCamera or kLevel";
  }
  if (wrong) throw Error(ErrorCode::kInvalidArgument, wrong);
}

bool in_cut(const Cluster& cluster, const std::vector<uint8_t>& refined) {
  return refined[cluster.group] &&
         (cluster.generating_group == kNone || !refined[cluster.generating_group]);
}

/// Groups that must be refined, found from the root of the hierarchy down.
std::vector<uint32_t> refined_groups(const Tables& tables, const View& view) {
  std::vector<uint32_t> found, stack;
  if (!tables.nodes.empty()) stack.push_back(0);
  while (!stack.empty()) {
    const Node& node = tables.nodes[stack.back()];
    stack.pop_back();
    if (node.group != kNone) {
      if (must_refine(tables.groups[node.group], view)) found.push_back(node.group);
    } else if (view.kind == View::Kind::kLevel || error_too_large(node.sphere, node.error, view)) {
      for (uint32_t i = 0; i < node.children.count; ++i) stack.push_back(node.children.offset + i);
    }
  }
  std::sort(found.begin(), found.end(), [&](uint32_t a, uint32_t b) {
    return tables.groups[a].clusters.offset < tables.groups[b].clusters.offset;
  });
  return found;
}

}  // namespace

bool must_refine(const Group& group, const View& view) {
  if (view.kind == View::Kind::kLevel)
    return group.level >= view.level || group.error == std::numeric_limits<float>::infinity();
  return error_too_large(group.sphere, group.error, view);
}

std::vector<uint32_t> select(const Tables& tables, const View& view) {
  check(view);
  std::vector<uint8_t> refined(tables.groups.size());
  parallel_for(tables.groups.size(), kChunk,
               [&](size_t g) { refined[g] = must_refine(tables.groups[g], view); });

  const size_t count = tables.clusters.size();
  std::vector<size_t> offsets((count + kChunk - 1) / kChunk + 1, 0);
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    size_t selected = 0;
    for (size_t c = begin; c < end; ++c) selected += in_cut(tables.clusters[c], refined);
    offsets[begin / kChunk + 1] = selected;
  });
  std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());

  std::vector<uint32_t> cut(offsets.back());
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    size_t at = offsets[begin / kChunk];
    for (size_t c = begin; c < end; ++c)
      if (in_cut(tables.clusters[c], refined)) cut[at++] = static_cast<uint32_t>(c);
  });
  return cut;
}

std::vector<uint32_t> select_hierarchy(const Tables& tables, const View& view) {
  check(view);
  std::vector<uint32_t> cut;
  for (const uint32_t g : refined_groups(tables, view)) {
    const Range& range = tables.groups[g].clusters;
    // Clusters made from the same group stand together, so the last answer often holds.
    uint32_t asked = kNone;
    bool generating_refined = false;
    for (uint32_t c = range.offset; c < range.offset + range.count; ++c) {
      const uint32_t generating = tables.clusters[c].generating_group;
      if (generating != asked) {
        generating_refined = generating != kNone && must_refine(tables.groups[generating], view);
        asked = generating;
      }
      if (!generating_refined) cut.push_back(c);
    }
  }
  return cut;
}

float error_for_triangles(const Tables& tables, uint64_t max_triangles) {
  // A cluster is in the cut of every error in [its generating group's, its group's).
  struct Event {
    float error;
    int64_t triangles;
  };
  std::vector<Event> events;
  events.reserve(2 * tables.clusters.size());
  int64_t triangles = 0;
  float coarsest = 0;
  for (const Group& group : tables.groups)
    if (std::isfinite(group.error)) coarsest = std::max(coarsest, group.error);
  for (const Cluster& cluster : tables.clusters) {
    const float enters =
        cluster.generating_group == kNone ? 0.0f : tables.groups[cluster.generating_group].error;
    const float leaves = tables.groups[cluster.group].error;
    if (!(enters < leaves)) continue;
    events.push_back({enters, cluster.triangle_count});
    if (std::isfinite(leaves)) events.push_back({leaves, -int64_t{cluster.triangle_count}});
  }
  std::sort(events.begin(), events.end(),
            [](const Event& a, const Event& b) { return a.error < b.error; });
  size_t i = 0;
  for (float error = 0; true; error = events[i].error) {
    for (; i < events.size() && events[i].error <= error; ++i) triangles += events[i].triangles;
    if (triangles <= static_cast<int64_t>(std::min<uint64_t>(max_triangles, INT64_MAX)))
      return error;
    if (i == events.size()) return coarsest;
  }
}

float cut_error(const Tables& tables, std::span<const uint32_t> cut) {
  float error = 0;
  for (const uint32_t c : cut) {
    if (c >= tables.clusters.size())
      throw Error(ErrorCode::kInvalidArgument, "cut_error: cluster " + std::to_string(c) +
                                                   " of the cut is out of range, there are " +
                                                   std::to_string(tables.clusters.size()));
    const uint32_t generating = tables.clusters[c].generating_group;
    if (generating != kNone) error = std::max(error, tables.groups[generating].error);
  }
  return error;
}

}  // namespace umbel::lod
