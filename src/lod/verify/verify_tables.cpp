// Verification of the tables: levels are ranges of groups, groups ranges of clusters, the
// hierarchy is a tree with one leaf a group, and errors and spheres grow towards the root.
#include "lod/verify/verify_tables.hpp"

#include <cmath>

#include "base/math.hpp"
#include "umbel/lod_select.hpp"

namespace umbel::lod {
namespace {

bool in_range(const Range& range, size_t count) {
  return uint64_t{range.offset} + range.count <= count;
}

bool is_infinite(float error) { return error == std::numeric_limits<float>::infinity(); }

bool verify_levels(const Tables& tables, Findings& findings) {
  uint64_t next = 0;
  for (size_t l = 0; l < tables.levels.size(); ++l) {
    const Range& level = tables.levels[l];
    if (level.offset != next || !in_range(level, tables.groups.size())) {
      findings.limit([&] {
        return "Level " + number(l) + " has the groups from " + number(level.offset) + ", " +
               number(level.count) + " of them, but should begin at " + number(next) +
               " and end within " + number(tables.groups.size());
      });
      return false;
    }
    next += level.count;
    for (uint32_t g = level.offset; g < level.offset + level.count; ++g)
      if (tables.groups[g].level != l) {
        findings.limit([&] {
          return "Group " + number(g) + " says level " + number(tables.groups[g].level) +
                 " but stands in level " + number(l);
        });
        return false;
      }
  }
  if (next == tables.groups.size()) return true;
  findings.limit([&] {
    return "The levels have " + number(next) + " groups, but there are " +
           number(tables.groups.size());
  });
  return false;
}

bool verify_group(const Tables& tables, uint32_t g, Findings& findings) {
  const Group& group = tables.groups[g];
  const auto complain = [&](const std::string& what) {
    findings.limit([&] { return "Group " + number(g) + " " + what; });
  };
  const bool has_range =
      in_range(group.clusters, tables.clusters.size()) && group.clusters.count > 0;
  if (!has_range)
    complain("has the clusters from " + number(group.clusters.offset) + ", " +
             number(group.clusters.count) + " of them, but there are " +
             number(tables.clusters.size()));
  if (static_cast<uint32_t>(group.method) > static_cast<uint32_t>(SimplifyMethod::kRoot))
    complain("has the unknown simplification method " +
             number(static_cast<uint32_t>(group.method)));
  else if ((group.method == SimplifyMethod::kRoot) != is_infinite(group.error))
    complain("has the simplification method " + number(static_cast<uint32_t>(group.method)) +
             " and the error " + text(group.error) +
             ", but an infinite error and the root method (4) belong together");
  if (!(group.error >= 0)) complain("has the error " + text(group.error) + ", below 0");
  if (!is_finite(group.sphere.center) || !std::isfinite(group.sphere.radius) ||
      group.sphere.radius < 0)
    complain("has the impossible " + text(group.sphere));
  return has_range;
}

/// That the groups' ranges hold every cluster once.
bool verify_partition(const Tables& tables, Findings& findings) {
  std::vector<uint32_t> owner(tables.clusters.size(), kNone);
  bool good = true;
  for (uint32_t g = 0; g < tables.groups.size(); ++g) {
    const Range& range = tables.groups[g].clusters;
    for (uint32_t c = range.offset; c < range.offset + range.count; ++c) {
      if (owner[c] != kNone) {
        good = false;
        findings.limit([&] {
          return "Cluster " + number(c) + " is in the ranges of group " + number(owner[c]) +
                 " and of group " + number(g);
        });
      }
      owner[c] = g;
    }
  }
  for (uint32_t c = 0; c < owner.size(); ++c)
    if (owner[c] == kNone || owner[c] != tables.clusters[c].group) {
      good = false;
      findings.limit([&] {
        return "Cluster " + number(c) + " says group " + number(tables.clusters[c].group) +
               " but is in the range of " +
               (owner[c] == kNone ? "none" : "group " + number(owner[c]));
      });
    }
  return good;
}

bool verify_generating(const Tables& tables, Findings& findings) {
  bool good = true;
  for (uint32_t c = 0; c < tables.clusters.size(); ++c) {
    const uint32_t from = tables.clusters[c].generating_group;
    if (from == kNone) continue;
    const auto complain = [&](const std::string& what) {
      findings.limit([&] {
        return "Cluster " + number(c) + " was made from group " + number(from) + ", " + what;
      });
    };
    if (from >= tables.groups.size()) {
      complain("but there are " + number(tables.groups.size()));
      good = false;
      continue;
    }
    const uint32_t to = tables.clusters[c].group;
    if (tables.groups[from].level >= tables.groups[to].level)
      complain("which is of level " + number(tables.groups[from].level) +
               ", not below its own group " + number(to) + " of level " +
               number(tables.groups[to].level));
    if (tables.groups[from].method == SimplifyMethod::kRoot)
      complain("which is a root and so was never simplified");
  }
  return good;
}

bool verify_leaf(const Tables& tables, uint32_t n, std::vector<uint32_t>& leaf_of,
                 Findings& findings) {
  const Node& node = tables.nodes[n];
  const auto complain = [&](const std::string& what) {
    findings.limit([&] { return "Node " + number(n) + " of the hierarchy " + what; });
    return false;
  };
  if (node.group >= tables.groups.size() || node.children.count != 0)
    return complain("is a leaf of group " + number(node.group) + " with " +
                    number(node.children.count) + " children, but there are " +
                    number(tables.groups.size()) + " groups and leaves have no children");
  if (leaf_of[node.group] != kNone)
    return complain("is a leaf of group " + number(node.group) + ", and so is node " +
                    number(leaf_of[node.group]));
  leaf_of[node.group] = n;
  const Group& group = tables.groups[node.group];
  if (!(node.sphere == group.sphere) || node.error != group.error)
    findings.not_monotone([&] {
      return "Node " + number(n) + " of the hierarchy has the error " + text(node.error) +
             " and the " + text(node.sphere) + ", but its group " + number(node.group) +
             " has the error " + text(group.error) + " and the " + text(group.sphere);
    });
  return true;
}

bool verify_hierarchy_links(const Tables& tables, Findings& findings) {
  bool good = true;
  std::vector<uint32_t> leaf_of(tables.groups.size(), kNone);
  std::vector<uint8_t> seen(tables.nodes.size(), 0);
  std::vector<uint32_t> stack;
  if (!tables.nodes.empty()) stack.push_back(0), seen[0] = 1;
  while (!stack.empty()) {
    const uint32_t n = stack.back();
    const Node& node = tables.nodes[n];
    stack.pop_back();
    if (node.group != kNone) {
      good &= verify_leaf(tables, n, leaf_of, findings);
      continue;
    }
    const Range& children = node.children;
    if (children.count == 0 || !in_range(children, tables.nodes.size())) {
      findings.limit([&] {
        return "Node " + number(n) + " of the hierarchy has the children from " +
               number(children.offset) + ", " + number(children.count) +
               " of them, but there are " + number(tables.nodes.size()) + " nodes";
      });
      return false;
    }
    for (uint32_t i = children.offset; i < children.offset + children.count; ++i) {
      if (seen[i]) {
        findings.limit([&] {
          return "Node " + number(i) + " of the hierarchy has two parents, one of them node " +
                 number(n);
        });
        return false;
      }
      seen[i] = 1;
      stack.push_back(i);
    }
  }
  for (uint32_t g = 0; g < leaf_of.size(); ++g)
    if (leaf_of[g] == kNone) {
      good = false;
      findings.limit([&] { return "Group " + number(g) + " is no leaf of the hierarchy"; });
    }
  return good;
}

void verify_node(const Tables& tables, uint32_t n, Findings& findings) {
  const Node& node = tables.nodes[n];
  for (uint32_t i = 0; i < node.children.count; ++i) {
    const uint32_t c = node.children.offset + i;
    const Node& child = tables.nodes[c];
    if (!(node.error >= child.error))
      findings.not_monotone([&] {
        return "Node " + number(n) + " of the hierarchy has the error " + text(node.error) +
               ", less than its child " + number(c) + " with " + text(child.error);
      });
    if (!is_infinite(node.error) && !contains(node.sphere, child.sphere))
      findings.not_monotone([&] {
        return "Node " + number(n) + " of the hierarchy has the " + text(node.sphere) +
               ", which does not contain that of its child " + number(c) + ", the " +
               text(child.sphere);
      });
  }
}

}  // namespace

bool contains(const Sphere& outer, const Sphere& inner) {
  constexpr double kTolerance = 1e-6;
  const double x = double{outer.center.x} - inner.center.x;
  const double y = double{outer.center.y} - inner.center.y;
  const double z = double{outer.center.z} - inner.center.z;
  return std::sqrt(x * x + y * y + z * z) + inner.radius <=
         double{outer.radius} * (1 + kTolerance) + std::numeric_limits<float>::denorm_min();
}

bool verify_links(const Tables& tables, Findings& findings) {
  findings.begin_stage();
  if (!verify_levels(tables, findings)) return false;
  bool good = true;
  for (uint32_t g = 0; g < tables.groups.size(); ++g) good &= verify_group(tables, g, findings);
  if (!good || !verify_partition(tables, findings)) return false;
  good = verify_generating(tables, findings);
  return verify_hierarchy_links(tables, findings) && good;
}

void verify_monotone(const Tables& tables, Findings& findings) {
  findings.begin_stage();
  uint32_t last_from = kNone, last_to = kNone;
  for (const Cluster& cluster : tables.clusters) {
    const uint32_t from = cluster.generating_group, to = cluster.group;
    if (from == kNone || (from == last_from && to == last_to)) continue;
    last_from = from, last_to = to;
    const Group& fine = tables.groups[from];
    const Group& coarse = tables.groups[to];
    if (!(coarse.error >= fine.error))
      findings.not_monotone([&] {
        return "Group " + number(to) + " has the error " + text(coarse.error) +
               ", less than its generating group " + number(from) + " with " + text(fine.error);
      });
    if (!contains(coarse.sphere, fine.sphere))
      findings.not_monotone([&] {
        return "Group " + number(to) + " has the " + text(coarse.sphere) +
               ", which does not contain that of its generating group " + number(from) + ", the " +
               text(fine.sphere);
      });
  }
  for (uint32_t n = 0; n < tables.nodes.size(); ++n) verify_node(tables, n, findings);
}

void validate(const Tables& tables) {
  VerifyReport report;
  Findings findings(report);
  if (verify_links(tables, findings)) return;
  throw Error(ErrorCode::kCorrupt,
              report.problems.empty() ? "the tables' links do not fit" : report.problems.front());
}

}  // namespace umbel::lod
