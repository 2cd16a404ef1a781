#include "cluster/meshlet/meshlet.hpp"

#include <span>
#include <string>

#include "base/refuse.hpp"

namespace umbel::cluster {
namespace {

void check_item(const MeshView& mesh, const Clusters& clusters, uint32_t at) {
  const uint32_t item = clusters.items[at];
  if (item >= mesh.triangles.size())
    refuse("clusters.items[" + std::to_string(at) + "] is " + std::to_string(item) +
           ", but there are " + std::to_string(mesh.triangles.size()) + " triangles");
  for (const uint32_t v : mesh.triangles[item])
    if (v >= mesh.positions.size())
      throw Error(ErrorCode::kInvalidMesh,
                  "triangle " + std::to_string(item) + " uses vertex " + std::to_string(v) +
                      ", but there are " + std::to_string(mesh.positions.size()) + " positions");
}

}  // namespace

void validate_clusters(const MeshView& mesh, const Clusters& clusters) {
  std::vector<bool> taken(clusters.items.size(), false);
  for (size_t c = 0; c < clusters.ranges.size(); ++c) {
    const Range& r = clusters.ranges[c];
    const std::string name = "clusters.ranges[" + std::to_string(c) + "]";
    if (r.count == 0 || uint64_t(r.offset) + r.count > clusters.items.size())
      refuse(name + " is empty or ends past the items");
    if (r.count > kMaxMeshletTriangles)
      refuse(name + " has " + std::to_string(r.count) + " triangles, more than " +
             std::to_string(kMaxMeshletTriangles) + ": give a smaller max_items");
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
      if (taken[i]) refuse(name + " overlaps another one at item " + std::to_string(i));
      taken[i] = true;
      check_item(mesh, clusters, i);
    }
  }
}

void Meshlet::load(const MeshView& mesh, const Clusters& clusters, size_t cluster) {
  const Range& r = clusters.ranges[cluster];
  vertices.clear();
  corners.resize(r.count);
  table_.clear(size_t(r.count) * 3);
  for (uint32_t i = 0; i < r.count; ++i) {
    const Triangle& t = mesh.triangles[clusters.items[r.offset + i]];
    for (int k = 0; k < 3; ++k) {
      const uint32_t number = table_.insert(t[k]);
      if (number >= kMaxMeshletVertices)
        refuse("cluster " + std::to_string(cluster) + " has more than " +
               std::to_string(kMaxMeshletVertices) + " vertices: set max_vertices");
      if (number == vertices.size()) vertices.push_back(t[k]);
      corners[i][k] = static_cast<uint8_t>(number);
    }
  }
}

}  // namespace umbel::cluster
