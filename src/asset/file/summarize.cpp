// What all pages say together, read one at a time.
#include <algorithm>
#include <limits>

#include "base/progress.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

void add(MeshSummary& summary, const PageGroup& group) {
  const bool is_root = group.group.error == std::numeric_limits<float>::infinity();
  summary.root_groups += is_root;
  for (const lod::Cluster& cluster : group.clusters) {
    summary.triangles += cluster.triangle_count;
    if (is_root) summary.root_triangles += cluster.triangle_count;
    summary.root_clusters += is_root;
    summary.max_triangles = std::max(summary.max_triangles, cluster.triangle_count);
    summary.max_vertices = std::max(summary.max_vertices, cluster.vertex_count);
    summary.max_material = std::max(summary.max_material, cluster.material);
  }
}

}  // namespace

std::vector<MeshSummary> summarize(const Asset& asset, const BuildOptions& options) {
  Progress progress(options);
  std::vector<MeshSummary> all(asset.meshes().size());
  const uint32_t pages = asset.info().pages;
  for (uint32_t p = 0; p < pages; ++p) {
    if (p % 256 == 0) progress.report(double(p) / pages, "reading pages");
    for (const PageGroup& group : asset.read_page(p).groups) add(all[group.mesh], group);
  }
  return all;
}

}  // namespace umbel
