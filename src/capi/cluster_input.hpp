// What umbel_cluster.h's functions are given, as the C++ interface takes it.
#pragma once

#include <vector>

#include "umbel/cluster.hpp"
#include "umbel/umbel_cluster.h"

namespace umbel::capi {

/// What ClusterConfig and umbel_cluster_config have in common.
#define CLUSTER_CONFIG_FIELDS                                                              \
  min_items, max_items, max_vertices, underfill_cost, overlap_cost, vertex_underfill_cost, \
      presplit_threshold, coarse

/// The caller's options; none where `options` is NULL.
BuildOptions build_options(const umbel_build_options* options);

ClusterConfig cluster_config(const umbel_cluster_config* config);

/// A copy of the caller's clusters: ranges and items only.
Clusters given_clusters(const umbel_cluster_output* clusters);

/// What umbel_cluster_requirements looks at.
struct ItemCounts {
  explicit ItemCounts(const umbel_cluster_input& in);
  size_t items;
  bool has_segments;  ///< else all items are one
  std::span<const Range> segments;
};

/// Views of the caller's arrays. Checks that what must be there is there; what the arrays hold is
/// checked by who reads them.
class ClusterArrays {
 public:
  explicit ClusterArrays(const umbel_cluster_input* input);

  const ItemCounts& counts() const { return counts_; }
  size_t item_count() const { return item_count_; }
  bool has_positions() const { return has_positions_; }
  float shared_vertex_weight() const { return input_.shared_vertex_weight; }

  /// Whether `mesh` alone is all that there is to cluster.
  bool is_mesh_alone() const;
  /// The triangles, where there are positions.
  const MeshView& mesh() const { return mesh_; }
  /// The items. Makes the boxes first where there are positions.
  const ClusterInput& items(const BuildOptions& options);

 private:
  explicit ClusterArrays(const umbel_cluster_input& in);
  void read_positions(const umbel_cluster_input& in);

  ItemCounts counts_;
  size_t item_count_ = 0;
  bool has_positions_ = false;
  ClusterInput input_;
  MeshView mesh_;
  std::vector<Vec3> positions_;  // where the caller's have gaps
  std::vector<Aabb> boxes_;
};

}  // namespace umbel::capi
