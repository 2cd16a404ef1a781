#include "lod/verify/table_structure.hpp"

namespace umbel::lod {
namespace {

std::string leaves(const std::string& what, size_t index, const char* field, const Range& range,
                   const char* table, size_t size) {
  return what + " " + std::to_string(index) + " has " + field + " [" +
         std::to_string(range.offset) + ", " +
         std::to_string(uint64_t{range.offset} + range.count) + "), but there are " +
         std::to_string(size) + " " + table;
}

std::string bad_link(const std::string& what, size_t index, const char* field, uint32_t value,
                     const char* table, size_t size) {
  return what + " " + std::to_string(index) + " has " + field + " " + std::to_string(value) +
         ", but there are " + std::to_string(size) + " " + table;
}

std::string level_fault(const Tables& tables) {
  for (size_t i = 0; i < tables.levels.size(); ++i)
    if (!is_within(tables.levels[i], tables.groups.size()))
      return leaves("level", i, "groups", tables.levels[i], "groups", tables.groups.size());
  return {};
}

std::string group_fault(const Tables& tables, size_t clusters) {
  std::vector<bool> owned(clusters);
  for (size_t i = 0; i < tables.groups.size(); ++i) {
    const Group& group = tables.groups[i];
    if (!is_within(group.clusters, clusters))
      return leaves("group", i, "clusters", group.clusters, "clusters", clusters);
    if (group.method > SimplifyMethod::kRoot)
      return "group " + std::to_string(i) + " has the unknown simplification method " +
             std::to_string(static_cast<uint32_t>(group.method));
    for (uint32_t c = 0; c < group.clusters.count; ++c) {
      if (owned[group.clusters.offset + c])
        return "cluster " + std::to_string(group.clusters.offset + c) +
               " is in the cluster ranges of two groups";
      owned[group.clusters.offset + c] = true;
    }
  }
  for (size_t c = 0; c < owned.size(); ++c)
    if (!owned[c]) return "cluster " + std::to_string(c) + " is in no group's cluster range";
  return {};
}

std::string cluster_fault(const Tables& tables) {
  const size_t groups = tables.groups.size();
  for (size_t i = 0; i < tables.clusters.size(); ++i) {
    const Cluster& cluster = tables.clusters[i];
    if (cluster.group >= groups)
      return bad_link("cluster", i, "group", cluster.group, "groups", groups);
    if (cluster.generating_group != kNone && cluster.generating_group >= groups)
      return bad_link("cluster", i, "generating group", cluster.generating_group, "groups", groups);
  }
  return {};
}

std::string node_fault(const Tables& tables) {
  // With one parent at most, and none for the root, what can be reached from it is a tree.
  std::vector<uint8_t> has_parent(tables.nodes.size());
  for (size_t i = 0; i < tables.nodes.size(); ++i) {
    const Node& node = tables.nodes[i];
    if (!is_within(node.children, tables.nodes.size()))
      return leaves("node", i, "children", node.children, "nodes", tables.nodes.size());
    if (node.group != kNone && node.group >= tables.groups.size())
      return bad_link("node", i, "group", node.group, "groups", tables.groups.size());
    for (uint32_t c = 0; c < node.children.count; ++c) {
      const uint32_t child = node.children.offset + c;
      if (child == 0) return "node " + std::to_string(i) + " has the root as a child";
      if (has_parent[child]++) return "node " + std::to_string(child) + " has two parents";
    }
  }
  return {};
}

}  // namespace

std::string structure_fault(const Tables& tables) {
  if (std::string fault = structure_fault_but_clusters(tables, tables.clusters.size());
      !fault.empty())
    return fault;
  return cluster_fault(tables);
}

std::string structure_fault_but_clusters(const Tables& tables, size_t clusters) {
  if (std::string fault = level_fault(tables); !fault.empty()) return fault;
  if (std::string fault = group_fault(tables, clusters); !fault.empty()) return fault;
  return node_fault(tables);
}

}  // namespace umbel::lod
