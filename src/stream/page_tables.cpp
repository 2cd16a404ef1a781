#include "stream/page_tables.hpp"

namespace umbel::stream {

PageTables::PageTables(const Asset& asset) : tables_(asset.info().pages) {
  for (const AssetMesh& mesh : asset.meshes()) in_page_.emplace_back(mesh.groups);
}

void PageTables::add(const AssetPage& page) {
  for (uint32_t i = 0; i < page.groups.size(); ++i)
    in_page_[page.groups[i].mesh][page.groups[i].id] = i;
  Table& table = tables_[page.index];
  table = {};
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
}

uint32_t PageTables::find(uint32_t mesh, const GroupRef& reference) const {
  const std::vector<Group>& groups = tables_[reference.page].groups;
  const uint32_t at = in_page_[mesh][reference.group];
  if (at + 1 >= groups.size()) return kNone;
  return groups[at].group == reference.group && groups[at].mesh == mesh ? at : kNone;
}

}  // namespace umbel::stream
