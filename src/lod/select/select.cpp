// Selection of a cut by tests that are independent of each other (Karis, "Nanite: A Deep Dive",
// 2021): a cluster is in the cut if its group must be refined and the group that it was made
// from need not be. Errors and spheres never shrink from a generating group to the groups of
// what it generated, so along every path through the DAG exactly one cluster answers yes (nested
// errors and spheres: Lindstrom and Pascucci, "Visualization of large terrains made easy", 2001).
#include <algorithm>
#include <bit>
#include <numeric>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "lod/select/cull.hpp"

namespace umbel::lod {
namespace {

constexpr size_t kChunk = 1 << 14;

// What is known of a group before its clusters are tested.
enum : uint8_t { kRefined = 1, kVisible = 2 };

bool in_cut(const Cluster& cluster, const std::vector<uint8_t>& groups) {
  return groups[cluster.group] == (kRefined | kVisible) &&
         (cluster.generating_group == kNone || !(groups[cluster.generating_group] & kRefined));
}

bool is_shown(const Group& group, const View& view, const Culling& culling) {
  return must_refine(group, view) && !is_outside(group.sphere, culling.planes);
}

// A set of groups that gives them back in the order of their clusters.
class GroupSet {
 public:
  explicit GroupSet(const Tables& tables)
      : tables_(tables), words_((tables.groups.size() + 63) / 64, 0) {}

  void insert(uint32_t group) { words_[group / 64] |= uint64_t{1} << group % 64; }

  std::vector<uint32_t> in_order() const {
    std::vector<uint32_t> groups;
    for (size_t w = 0; w < words_.size(); ++w)
      for (uint64_t bits = words_[w]; bits; bits &= bits - 1)
        groups.push_back(static_cast<uint32_t>(64 * w + std::countr_zero(bits)));
    const auto earlier = [&](uint32_t a, uint32_t b) {
      return tables_.groups[a].clusters.offset < tables_.groups[b].clusters.offset;
    };
    // They are unless the tables come from elsewhere.
    if (!std::is_sorted(groups.begin(), groups.end(), earlier))
      std::sort(groups.begin(), groups.end(), earlier);
    return groups;
  }

 private:
  const Tables& tables_;
  std::vector<uint64_t> words_;
};

// Appends the clusters of the cut that a group has.
void append_cut(const Tables& tables, const View& view, const Culling& culling, uint32_t group,
                std::vector<uint32_t>& cut) {
  const bool culls = !culling.planes.empty() || !culling.normal_cones.empty();
  const Range& range = tables.groups[group].clusters;
  // Clusters made from the same group stand together, so the last answer often holds.
  uint32_t asked = kNone;
  bool generating_refined = false;
  for (uint32_t c = range.offset; c < range.offset + range.count; ++c) {
    const uint32_t generating = tables.clusters[c].generating_group;
    if (generating != asked) {
      generating_refined = generating != kNone && must_refine(tables.groups[generating], view);
      asked = generating;
    }
    if (generating_refined || (culls && !is_visible(tables, c, view, culling))) continue;
    cut.push_back(c);
  }
}

std::vector<uint32_t> cut_of(const Tables& tables, const View& view, const Culling& culling,
                             const GroupSet& groups) {
  std::vector<uint32_t> cut;
  for (const uint32_t g : groups.in_order()) append_cut(tables, view, culling, g, cut);
  return cut;
}

}  // namespace

void check(const View& view) {
  const char* wrong = nullptr;
  switch (view.kind) {
    case View::Kind::kError:
      if (!(view.error >= 0)) wrong = "the view's error must be at least 0";
      break;
    case View::Kind::kCamera:
      if (!(view.threshold >= 0)) wrong = "the view's threshold must be at least 0";
      if (!is_finite(view.eye)) wrong = "the view's eye must be finite";
      break;
    case View::Kind::kLevel:
      break;
    default:
      wrong = "the view is neither by error, by camera nor by level";
  }
  if (wrong) throw Error(ErrorCode::kInvalidArgument, wrong);
}

void check(const Tables& tables, const View& view, const Culling& culling) {
  check(view);
  const auto reject = [](const std::string& sentence) {
    throw Error(ErrorCode::kInvalidArgument, sentence);
  };
  for (size_t i = 0; i < culling.planes.size(); ++i) {
    const Plane& plane = culling.planes[i];
    const double length = std::hypot(double{plane.normal.x}, plane.normal.y, plane.normal.z);
    if (!(std::fabs(length - 1) <= 1e-5) || !std::isfinite(plane.offset))
      reject("planes[" + std::to_string(i) +
             "] must have a normal of length 1 and a finite offset, but has the length " +
             printed(length) + " and the offset " + printed(plane.offset));
  }
  if (culling.normal_cones.empty()) return;
  if (culling.normal_cones.size() != tables.clusters.size())
    reject("normal_cones has " + std::to_string(culling.normal_cones.size()) +
           " elements, but there are " + std::to_string(tables.clusters.size()) + " clusters");
  if (view.kind != View::Kind::kCamera)
    reject("normal_cones needs a view by camera: other views have no eye");
}

bool must_refine(const Group& group, const View& view) {
  return must_refine(group.sphere, group.error, group.level, view);
}

std::vector<uint32_t> select(const Tables& tables, const View& view) {
  return select(tables, view, Culling{});
}

std::vector<uint32_t> select_hierarchy(const Tables& tables, const View& view) {
  return select_hierarchy(tables, view, Culling{});
}

std::vector<uint32_t> select(const Tables& tables, const View& view, const Culling& culling) {
  check(tables, view, culling);
  std::vector<uint8_t> groups(tables.groups.size());
  parallel_for(tables.groups.size(), kChunk, [&](size_t g) {
    const Group& group = tables.groups[g];
    groups[g] = static_cast<uint8_t>((must_refine(group, view) ? kRefined : 0) |
                                     (is_outside(group.sphere, culling.planes) ? 0 : kVisible));
  });

  const size_t count = tables.clusters.size();
  const auto chosen = [&](size_t c) {
    return in_cut(tables.clusters[c], groups) &&
           is_visible(tables, static_cast<uint32_t>(c), view, culling);
  };
  std::vector<size_t> offsets((count + kChunk - 1) / kChunk + 1, 0);
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    size_t selected = 0;
    for (size_t c = begin; c < end; ++c) selected += chosen(c);
    offsets[begin / kChunk + 1] = selected;
  });
  std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());

  std::vector<uint32_t> cut(offsets.back());
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    size_t at = offsets[begin / kChunk];
    for (size_t c = begin; c < end; ++c)
      if (chosen(c)) cut[at++] = static_cast<uint32_t>(c);
  });
  return cut;
}

std::vector<uint32_t> select_hierarchy(const Tables& tables, const View& view,
                                       const Culling& culling) {
  check(tables, view, culling);
  GroupSet groups(tables);
  std::vector<uint32_t> stack;
  if (!tables.nodes.empty()) stack.push_back(0);
  while (!stack.empty()) {
    const Node& node = tables.nodes[stack.back()];
    stack.pop_back();
    if (node.group != kNone) {
      if (is_shown(tables.groups[node.group], view, culling)) groups.insert(node.group);
    } else if (must_descend(node, view, culling.planes)) {
      for (uint32_t i = 0; i < node.children.count; ++i) stack.push_back(node.children.offset + i);
    }
  }
  return cut_of(tables, view, culling, groups);
}

std::vector<uint32_t> select_breadth_first(const Tables& tables, const View& view,
                                           const Culling& culling) {
  check(tables, view, culling);
  GroupSet groups(tables);
  std::vector<uint32_t> layer, next;
  if (!tables.nodes.empty()) layer.push_back(0);
  while (!layer.empty()) {
    // Each node says by itself how many nodes of the next layer are below it: nothing, for a leaf.
    // A scan of those numbers is where each of them writes its children.
    next.clear();
    for (const uint32_t n : layer) {
      const Node& node = tables.nodes[n];
      if (node.group != kNone) {
        if (is_shown(tables.groups[node.group], view, culling)) groups.insert(node.group);
      } else if (must_descend(node, view, culling.planes)) {
        for (uint32_t i = 0; i < node.children.count; ++i) next.push_back(node.children.offset + i);
      }
    }
    std::swap(layer, next);
  }
  return cut_of(tables, view, culling, groups);
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
