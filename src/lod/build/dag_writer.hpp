// Writes groups and their clusters into the DAG, level by level.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/build/group_sink.hpp"
#include "lod/dag/cluster_set.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

class DagWriter : public GroupSink {
 public:
  explicit DagWriter(Dag& dag) : dag_(dag) { dag_.vertex_offsets = dag_.triangle_offsets = {0}; }

  /// Room for levels that shrink as they are asked to, above these clusters.
  void reserve(const ClusterSet& finest);

  /// Groups must be the only ones of the DAG: the generating groups of their clusters are numbered
  /// as they were added.
  void add_group(const NewGroup& group) override;
  void finish_level(const ClusterSet& pending) override;

 private:
  void write_clusters(const ClusterSet& pending);

  Dag& dag_;
  uint32_t first_group_ = 0;       // of the level
  std::vector<uint32_t> members_;  // pending clusters of the level's groups, group by group
};

/// In groups_by_method and groups_by_limiting_factor.
void count_group(SimplifyMethod method, LimitingFactor factor, Report& report);

/// Keeps the materials of vertices as one more attribute.
void keep_vertex_materials(std::span<const uint32_t> materials, Mesh& mesh);

}  // namespace umbel::lod
