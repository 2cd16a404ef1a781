#include "tables.hpp"

#include <algorithm>
#include <stdexcept>

#include "cluster_words.hpp"
#include "layouts.hpp"

namespace sample {

namespace {

const umbel::lod::Tables& only_mesh(const umbel::Asset& asset) {
  if (asset.meshes().size() != 1) throw std::runtime_error("the sample draws assets of one mesh.");
  return asset.tables();
}

}  // namespace

Tables::Tables(const Device& device, const umbel::Asset& asset)
    : host_(only_mesh(asset)),
      max_triangles_(asset.info().max_triangles),
      max_vertices_(asset.info().max_vertices),
      page_of_group_(host_.groups.size()),
      words_of_cluster_(host_.clusters.size()),
      nodes_(device, host_.nodes.size() * sizeof(GpuNode), Place::kDevice),
      groups_(device, host_.groups.size() * sizeof(GpuGroup), Place::kDevice),
      clusters_(device, host_.clusters.size() * sizeof(GpuCluster), Place::kDevice) {
  place_clusters(asset);
  count_layers();
  upload();
}

void Tables::place_clusters(const umbel::Asset& asset) {
  for (uint32_t p = 0; p < asset.info().pages; ++p) {
    const umbel::AssetPage page = asset.read_page(p);
    PageLayout& layout = pages_.emplace_back();
    for (const umbel::PageGroup& group : page.groups) {
      layout.groups.push_back(group.id);
      page_of_group_[group.id] = p;
      for (uint32_t c = 0; c < group.clusters.size(); ++c) {
        const umbel::lod::Cluster& cluster = group.clusters[c];
        words_of_cluster_[group.group.clusters.offset + c] = layout.words;
        layout.words += words_of(cluster.vertex_count, cluster.triangle_count);
      }
    }
  }
}

void Tables::count_layers() {
  std::vector<uint32_t> layer{0}, next;
  for (; !layer.empty(); layer.swap(next)) {
    next.clear();
    for (const uint32_t n : layer) {
      const umbel::Range children = host_.nodes[n].children;
      for (uint32_t c = 0; c < children.count; ++c) next.push_back(children.offset + c);
    }
    ++layers_;
  }
  // Each layer counts what it passes on in the next one's entry.
  if (layers_ >= kMostLayers) throw std::runtime_error("the hierarchy has too many layers.");
}

void Tables::upload() const {
  std::vector<GpuNode> nodes;
  for (const umbel::lod::Node& n : host_.nodes) {
    nodes.push_back(
        {n.sphere.center, n.sphere.radius, n.error, n.group, n.children.offset, n.children.count});
  }
  nodes_.fill(std::as_bytes(std::span(nodes)));
  std::vector<GpuGroup> groups;
  for (uint32_t g = 0; g < host_.groups.size(); ++g) {
    const umbel::lod::Group& from = host_.groups[g];
    groups.push_back({from.sphere.center, from.sphere.radius, from.error, from.clusters.offset,
                      from.clusters.count, page_of_group_[g]});
  }
  groups_.fill(std::as_bytes(std::span(groups)));
  std::vector<GpuCluster> clusters;
  for (uint32_t c = 0; c < host_.clusters.size(); ++c) {
    const umbel::lod::Cluster& from = host_.clusters[c];
    clusters.push_back({from.box.min, from.box.max, from.group, from.generating_group,
                        words_of_cluster_[c], from.vertex_count, from.triangle_count});
  }
  clusters_.fill(std::as_bytes(std::span(clusters)));
}

uint32_t Tables::largest_page_words() const {
  uint32_t most = 0;
  for (const PageLayout& page : pages_) most = std::max(most, page.words);
  return most;
}

}  // namespace sample
