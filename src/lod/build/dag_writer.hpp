// Writes groups and their clusters into the DAG, level by level.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/cluster_set.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

class DagWriter {
 public:
  explicit DagWriter(Dag& dag) : dag_(dag) { dag_.vertex_offsets = dag_.triangle_offsets = {0}; }

  /// Room for levels that shrink as they are asked to, above these clusters.
  void reserve(const ClusterSet& finest);

  struct NewGroup {
    std::span<const uint32_t> members;  ///< of the pending clusters
    SimplifyMethod method;
    LimitingFactor limiting_factor;
    float error;
    std::span<const Vec3> new_positions = {};  ///< that it has once simplified, but not before
  };
  /// Adds a group of pending clusters to the level; returns its number. `spheres` are those of the
  /// clusters' generating groups, or at level 0 their own.
  uint32_t add_group(const ClusterSet& pending, std::span<const Sphere> spheres,
                     const NewGroup& group);
  /// Moves the clusters of the groups that were added into the DAG. False: there were none, so no
  /// level either.
  bool finish_level(const ClusterSet& pending);

 private:
  void write_clusters(const ClusterSet& pending);

  Dag& dag_;
  uint32_t first_group_ = 0;       // of the level
  std::vector<uint32_t> members_;  // pending clusters of the level's groups, group by group
};

/// Keeps the materials of vertices as one more attribute.
void keep_vertex_materials(std::span<const uint32_t> materials, Mesh& mesh);

}  // namespace umbel::lod
