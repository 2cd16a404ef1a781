// Groups triangles into clusters within the limits of triangles and vertices.
#pragma once

#include <span>
#include <vector>

#include "cluster/bisect/bisect.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"
#include "lod/dag/sub_mesh.hpp"

namespace umbel::lod {

ClusterConfig cluster_config(const Config& config);

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

/// For sub-meshes, one a worker thread; keeps its scratch memory.
class Clusteriser {
 public:
  explicit Clusteriser(const Config& config)
      : config_(cluster_config(config)), mix_(config.mix_materials) {}

  /// Appends the clusters of `sub_mesh` to `out`. A cluster has triangles of one material, unless
  /// Config::mix_materials. The order of the triangles is changed.
  void append(SubMesh& sub_mesh, uint32_t generating_group, ClusterSet& out);

 private:
  ClusterConfig config_;
  bool mix_;
  cluster::Bisector bisector_;
  Clusters clusters_;
  std::vector<Range> segments_;
  ClusterVertices numbers_;
};

/// For a whole mesh, in parallel; with the bounding sphere of each cluster.
void clusterise_source(const Source& source, const Config& config, ClusterSet& out,
                       std::vector<Sphere>& spheres);

}  // namespace umbel::lod
