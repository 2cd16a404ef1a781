// Cuts triangles into clusters within the limits of triangles and vertices.
#pragma once

#include <span>
#include <vector>

#include "cluster/bisect.hpp"
#include "lod/cluster_set.hpp"
#include "lod/source.hpp"

namespace umbel::lod {

ClusterConfig cluster_config(const Config& config);

/// For a piece of a mesh on a worker thread; keeps its scratch memory.
class ClusterCutter {
 public:
  explicit ClusterCutter(const Config& config)
      : config_(cluster_config(config)), mix_(config.mix_materials) {}

  /// Appends the clusters of `triangles` (indices into the source's vertices) to `out`. A cluster
  /// has triangles of one material, unless Config::mix_materials. The order of `triangles` is
  /// changed.
  void cut(const Source& source, std::span<Triangle> triangles, uint32_t generating_group,
           ClusterSet& out);

 private:
  ClusterConfig config_;
  bool mix_;
  cluster::Bisector bisector_;
  Clusters clusters_;
  std::vector<Range> segments_;
};

/// For a whole mesh, in parallel.
void cut_mesh(const Source& source, const Config& config, const BuildOptions& options,
              ClusterSet& out);

}  // namespace umbel::lod
