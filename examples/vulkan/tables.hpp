// What selection needs of a mesh, on the device for good: its groups, clusters and hierarchy, some
// 60 bytes a cluster. Geometry comes and goes by pages: page_pool.hpp.
#pragma once

#include <cstdint>
#include <umbel/umbel.hpp>
#include <vector>

#include "memory.hpp"

namespace sample {

/// What a page has: groups of the mesh, and how many words their geometry takes in the pool.
struct PageLayout {
  std::vector<uint32_t> groups;
  uint32_t words = 0;
};

class Tables {
 public:
  /// Reads all pages of the asset once. Throws for an asset of more than one mesh.
  Tables(const Device& device, const umbel::Asset& asset);

  const Buffer& nodes() const { return nodes_; }
  const Buffer& groups() const { return groups_; }
  const Buffer& clusters() const { return clusters_; }
  const umbel::lod::Tables& host() const { return host_; }
  const std::vector<PageLayout>& pages() const { return pages_; }
  uint32_t page_of_group(uint32_t group) const { return page_of_group_[group]; }
  /// From the start of its page.
  uint32_t word_of_cluster(uint32_t cluster) const { return words_of_cluster_[cluster]; }
  uint32_t layers() const { return layers_; }  ///< of the hierarchy
  uint32_t max_triangles() const { return max_triangles_; }
  uint32_t max_vertices() const { return max_vertices_; }
  uint32_t largest_page_words() const;

 private:
  void place_clusters(const umbel::Asset& asset);
  void count_layers();
  void upload() const;

  const umbel::lod::Tables& host_;
  uint32_t max_triangles_, max_vertices_;
  std::vector<uint32_t> page_of_group_, words_of_cluster_;
  std::vector<PageLayout> pages_;
  uint32_t layers_ = 0;
  Buffer nodes_, groups_, clusters_;
};

}  // namespace sample
