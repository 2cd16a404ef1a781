// One cluster's triangles by vertices of its own, and what a list of clusters must keep for that.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cluster/vertex_table.hpp"
#include "umbel/cluster.hpp"

namespace umbel::cluster {

/// Throws kInvalidArgument unless the ranges are within the items, not empty, do not overlap, are
/// no larger than kMaxMeshletTriangles, and the items are triangles of the mesh; and kInvalidMesh
/// for a vertex out of range.
void validate_clusters(const MeshView& mesh, const Clusters& clusters);

class Meshlet {
 public:
  /// Replaces what was there before. Vertices are numbered by first use. Throws
  /// kInvalidArgument if there are more than kMaxMeshletVertices.
  void load(const MeshView& mesh, const Clusters& clusters, size_t cluster);

  std::vector<uint32_t> vertices;  ///< of the mesh
  std::vector<std::array<uint8_t, 3>> corners;

 private:
  VertexTable table_;
};

}  // namespace umbel::cluster
