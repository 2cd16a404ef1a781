#include "stream/page_tables.hpp"

#include <utility>

namespace umbel::stream {

void PageTables::add(const AssetPage& page) {
  auto made = std::make_unique<Table>();
  Table& table = *made;
  table.groups.reserve(page.groups.size() + 1);
  const auto add_group = [&](uint32_t mesh, uint32_t group) {
    table.groups.push_back({mesh, group, static_cast<uint32_t>(table.children.size()),
                            static_cast<uint32_t>(table.generating_groups.size())});
  };
  for (const PageGroup& group : page.groups) {
    add_group(group.mesh, group.id);
    table.children.insert(table.children.end(), group.children.begin(), group.children.end());
    for (const lod::Cluster& cluster : group.clusters)
      table.generating_groups.push_back(cluster.generating_group);
  }
  add_group(kNone, kNone);
  tables_[page.index] = std::move(made);
}

uint32_t PageTables::find(uint32_t mesh, const GroupRef& reference) const {
  if (!has(reference.page)) return kNone;
  // A page has a handful of groups, so a number for each of an asset's would not pay.
  const std::vector<Group>& groups = tables_[reference.page]->groups;
  for (uint32_t at = 0; at + 1 < groups.size(); ++at)
    if (groups[at].group == reference.group && groups[at].mesh == mesh) return at;
  return kNone;
}

}  // namespace umbel::stream
