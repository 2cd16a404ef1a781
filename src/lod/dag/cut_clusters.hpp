// Cuts triangles into clusters within the limits of triangles and vertices.
#pragma once

#include <span>
#include <vector>

#include "cluster/bisect/bisect.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"

namespace umbel::lod {

ClusterConfig cluster_config(const Config& config);

/// Triangles with vertices of their own, numbered from 0, so that all is close together.
struct Piece {
  std::vector<Triangle> triangles;
  std::vector<uint32_t> vertices;   ///< of vertices: what clusters call them
  std::vector<Vec3> positions;      ///< of vertices
  std::vector<uint32_t> materials;  ///< of vertices; empty: one
};

/// The vertices of one cluster after the other, numbered as they come.
class ClusterVertices {
 public:
  /// Begins a cluster of vertices below `most`.
  void begin(size_t most);
  /// The number of a vertex that may have one already; else it gets `next`, below 256.
  uint8_t number(uint32_t vertex, uint32_t next, bool& is_new) {
    uint32_t& entry = numbers_[vertex];
    is_new = entry >> 8 != stamp_;
    entry = is_new ? stamp_ << 8 | next : entry;
    return static_cast<uint8_t>(entry);
  }

 private:
  std::vector<uint32_t> numbers_;  // of vertices, under the stamp of their cluster
  uint32_t stamp_ = 0;
};

/// For a piece of a mesh on a worker thread; keeps its scratch memory.
class ClusterCutter {
 public:
  explicit ClusterCutter(const Config& config)
      : config_(cluster_config(config)), mix_(config.mix_materials) {}

  /// Appends the clusters of `piece` to `out`. A cluster has triangles of one material, unless
  /// Config::mix_materials. The order of the triangles is changed.
  void cut(Piece& piece, uint32_t generating_group, ClusterSet& out);

 private:
  ClusterConfig config_;
  bool mix_;
  cluster::Bisector bisector_;
  Clusters clusters_;
  std::vector<Range> segments_;
  ClusterVertices numbers_;
};

/// For a whole mesh, in parallel; with the bounding sphere of each cluster.
void cut_mesh(const Source& source, const Config& config, ClusterSet& out,
              std::vector<Sphere>& spheres);

}  // namespace umbel::lod
