// What traversals read of the pages that are in memory, in compact tables: the pages of a large cut
// are far larger than caches.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "stream/tracked_node.hpp"
#include "umbel/asset.hpp"

namespace umbel::stream {

class PageTables {
 public:
  explicit PageTables(const Asset& asset) : tables_(asset.info().pages) {}

  void add(const AssetPage& page);
  void remove(uint32_t page) { tables_[page] = nullptr; }
  bool has(uint32_t page) const { return tables_[page] != nullptr; }

  /// The index of a group in its page. kNone where the page is not in memory, or does not have the
  /// group though the file refers to it.
  uint32_t find(uint32_t mesh, const GroupRef& reference) const;
  /// The groups that an open node's group was made from.
  std::span<const GroupRef> children(const TrackedNode& node) const {
    const Table& table = *tables_[node.reference.page];
    const Group* group = &table.groups[node.in_page];
    return std::span(table.children)
        .subspan(group->first_child, group[1].first_child - group->first_child);
  }
  /// For each of its clusters, the group that the cluster was made from, or kNone.
  std::span<const uint32_t> generating_groups(const TrackedNode& node) const {
    const Table& table = *tables_[node.reference.page];
    const Group* group = &table.groups[node.in_page];
    return std::span(table.generating_groups)
        .subspan(group->first_cluster, group[1].first_cluster - group->first_cluster);
  }

 private:
  struct Group {
    uint32_t mesh, group, first_child, first_cluster;
  };
  struct Table {
    std::vector<Group> groups;  // and one past the last
    std::vector<GroupRef> children;
    std::vector<uint32_t> generating_groups;
  };

  std::vector<std::unique_ptr<const Table>> tables_;  // by page; null: not in memory
};

}  // namespace umbel::stream
