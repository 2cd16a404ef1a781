#include "host_cut.hpp"

namespace sample {

void for_groups_of_cut(
    const umbel::lod::Tables& tables, std::span<const uint32_t> usable,
    const umbel::lod::View& view,
    const std::function<void(uint32_t group, std::span<const uint32_t> clusters)>& show) {
  const auto is_open = [&](uint32_t group) {
    return usable[group] != 0 && umbel::lod::must_refine(tables.groups[group], view);
  };
  const auto may_be_open = [&](const umbel::lod::Node& node) {
    umbel::lod::Group bound{};
    bound.sphere = node.sphere;
    bound.error = node.error;
    return umbel::lod::must_refine(bound, view);
  };
  std::vector<uint32_t> nodes{0}, clusters;
  while (!nodes.empty()) {
    const umbel::lod::Node& node = tables.nodes[nodes.back()];
    nodes.pop_back();
    if (!may_be_open(node)) continue;
    for (uint32_t c = 0; c < node.children.count; ++c) nodes.push_back(node.children.offset + c);
    if (node.group == umbel::kNone || !is_open(node.group)) continue;
    const umbel::Range all = tables.groups[node.group].clusters;
    clusters.clear();
    for (uint32_t c = all.offset; c < all.offset + all.count; ++c) {
      const uint32_t finer = tables.clusters[c].generating_group;
      if (finer == umbel::kNone || !is_open(finer)) clusters.push_back(c);
    }
    if (!clusters.empty()) show(node.group, clusters);
  }
}

}  // namespace sample
