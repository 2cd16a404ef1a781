// Verification of the tables, after their structure: levels in order, each cluster in its group,
// every group one leaf of the hierarchy, and errors and spheres that grow towards the root.
#include "lod/verify/verify_tables.hpp"

#include <cctype>
#include <cmath>

#include "base/math.hpp"
#include "lod/verify/table_structure.hpp"
#include "umbel/lod/verify.hpp"

namespace umbel::lod {
namespace {

bool is_infinite(float error) { return error == std::numeric_limits<float>::infinity(); }

bool verify_levels(const Tables& tables, Findings& findings) {
  uint64_t next = 0;
  for (size_t l = 0; l < tables.levels.size(); ++l) {
    const Range& level = tables.levels[l];
    if (level.offset != next) {
      findings.limit([&] {
        return "Level " + number(l) + " has the groups from " + number(level.offset) +
               " on, but should have those from " + number(next);
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

/// Whether the group has clusters.
bool verify_group(const Tables& tables, uint32_t g, Findings& findings) {
  const Group& group = tables.groups[g];
  const auto complain = [&](const std::string& what) {
    findings.limit([&] { return "Group " + number(g) + " " + what; });
  };
  if (group.clusters.count == 0) complain("has no clusters");
  if ((group.method == SimplifyMethod::kRoot) != is_infinite(group.error))
    complain("has the simplification method " + number(static_cast<uint32_t>(group.method)) +
             " and the error " + text(group.error) +
             ", but an infinite error and the method of roots (4) belong together");
  if (!(group.error >= 0)) complain("has the error " + text(group.error) + ", below 0");
  if (!is_finite(group.sphere.center) || !std::isfinite(group.sphere.radius) ||
      group.sphere.radius < 0)
    complain("has the impossible " + text(group.sphere));
  return group.clusters.count > 0;
}

/// Whether each cluster names the group whose range it is in.
bool verify_owners(const Tables& tables, Findings& findings) {
  bool good = true;
  for (uint32_t g = 0; g < tables.groups.size(); ++g) {
    const Range& range = tables.groups[g].clusters;
    for (uint32_t c = range.offset; c < range.offset + range.count; ++c) {
      if (tables.clusters[c].group == g) continue;
      good = false;
      findings.limit([&] {
        return "Cluster " + number(c) + " says group " + number(tables.clusters[c].group) +
               " but is in the range of group " + number(g);
      });
    }
  }
  return good;
}

void verify_generating(const Tables& tables, Findings& findings) {
  for (uint32_t c = 0; c < tables.clusters.size(); ++c)
    if (const uint32_t from = tables.clusters[c].generating_group; from != kNone)
      verify_origin(tables, tables.clusters[c].group, from, "Cluster " + number(c), findings);
}

bool verify_leaf(const Tables& tables, uint32_t n, std::vector<uint32_t>& leaf_of,
                 Findings& findings) {
  const Node& node = tables.nodes[n];
  const auto complain = [&](const std::string& what) {
    findings.limit([&] { return "Node " + number(n) + " of the hierarchy " + what; });
    return false;
  };
  if (node.children.count != 0)
    return complain("is a leaf of group " + number(node.group) + " with " +
                    number(node.children.count) + " children, but leaves have none");
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

/// Whether every group is one leaf below the root.
bool verify_hierarchy(const Tables& tables, Findings& findings) {
  bool good = true;
  std::vector<uint32_t> leaf_of(tables.groups.size(), kNone);
  std::vector<uint32_t> stack;
  if (!tables.nodes.empty()) stack.push_back(0);
  while (!stack.empty()) {
    const uint32_t n = stack.back();
    const Node& node = tables.nodes[n];
    stack.pop_back();
    if (node.group != kNone) {
      good &= verify_leaf(tables, n, leaf_of, findings);
      continue;
    }
    if (node.children.count == 0) {
      findings.limit([&] {
        return "Node " + number(n) + " of the hierarchy has neither a group nor children";
      });
      return false;
    }
    for (uint32_t i = 0; i < node.children.count; ++i) stack.push_back(node.children.offset + i);
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

bool verify_groups(const Tables& tables, Findings& findings) {
  if (!verify_levels(tables, findings)) return false;
  bool good = true;
  for (uint32_t g = 0; g < tables.groups.size(); ++g) good &= verify_group(tables, g, findings);
  return good;
}

bool complain_of(std::string fault, Findings& findings) {
  if (fault.empty()) return false;
  fault[0] = static_cast<char>(std::toupper(fault[0]));
  findings.limit([&] { return fault; });
  return true;
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

void verify_origin(const Tables& tables, uint32_t to, uint32_t from, const std::string& what,
                   Findings& findings) {
  const auto complain = [&](const std::string& why) {
    findings.limit([&] { return what + " was made from group " + number(from) + ", " + why; });
  };
  if (tables.groups[from].level >= tables.groups[to].level)
    complain("which is of level " + number(tables.groups[from].level) +
             ", not below its own group " + number(to) + " of level " +
             number(tables.groups[to].level));
  if (tables.groups[from].method == SimplifyMethod::kRoot)
    complain("which is a root and so was never simplified");
}

bool verify_links(const Tables& tables, Findings& findings) {
  findings.begin_stage();
  if (complain_of(structure_fault(tables), findings)) return false;
  if (!verify_groups(tables, findings) || !verify_owners(tables, findings)) return false;
  verify_generating(tables, findings);
  return verify_hierarchy(tables, findings);
}

bool verify_links_but_clusters(const Tables& tables, size_t clusters, Findings& findings) {
  findings.begin_stage();
  if (complain_of(structure_fault_but_clusters(tables, clusters), findings)) return false;
  return verify_groups(tables, findings) && verify_hierarchy(tables, findings);
}

void verify_rise(const Tables& tables, uint32_t to, uint32_t from, Findings& findings) {
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

void verify_nodes(const Tables& tables, Findings& findings) {
  for (uint32_t n = 0; n < tables.nodes.size(); ++n) verify_node(tables, n, findings);
}

void verify_monotone(const Tables& tables, Findings& findings) {
  findings.begin_stage();
  uint32_t last_from = kNone, last_to = kNone;
  for (const Cluster& cluster : tables.clusters) {
    const uint32_t from = cluster.generating_group, to = cluster.group;
    if (from == kNone || (from == last_from && to == last_to)) continue;
    last_from = from, last_to = to;
    verify_rise(tables, to, from, findings);
  }
  verify_nodes(tables, findings);
}

void validate(const Tables& tables) {
  VerifyReport report;
  Findings findings(report);
  if (verify_links(tables, findings)) return;
  throw Error(ErrorCode::kCorrupt,
              report.problems.empty() ? "the tables' links do not fit" : report.problems.front());
}

}  // namespace umbel::lod
