// Spatial clusters of any items that have boxes: triangles, or clusters themselves.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// Weighted adjacency between items: item i is connected to
/// targets[ranges[i].offset .. + count) with those weights. Should be symmetric.
struct Connections {
  std::span<const Range> ranges;    ///< one an item, or empty: no connections
  std::span<const uint32_t> targets;
  std::span<const float> weights;   ///< >= 0, one a target, or empty: all 1
};

struct ClusterInput {
  std::span<const Aabb> boxes;
  std::span<const Vec3> centroids;  ///< one an item, or empty: the boxes' centres
  Connections connections;
  /// Vertex indices of each item, `vertices_per_item` apiece (3 for triangles), or empty.
  /// Needed for ClusterConfig::max_vertices.
  std::span<const uint32_t> item_vertices;
  uint32_t vertices_per_item = 0;
  /// Weight of one shared vertex as a connection between two items, made from `item_vertices`
  /// (0: vertices make no connections).
  float shared_vertex_weight = 0.0f;
  /// Item ranges that are clustered each by itself; they must not overlap. Empty: one segment
  /// of all items. Items in no segment stay where they are.
  std::span<const Range> segments;
};

struct ClusterConfig {
  uint32_t min_items = 64;          ///< >= 1, <= max_items
  uint32_t max_items = 128;         ///< >= 1
  uint32_t max_vertices = 0;        ///< most unique vertices a cluster; 0: no limit
  float underfill_cost = 0.5f;      ///< [0, 1]: price of items missing to full clusters
  float overlap_cost = 0.0f;        ///< [0, 1]: price of overlap between the two sides
  float vertex_underfill_cost = 0.5f;  ///< [0, 1]: the same for missing vertices
  /// Nodes with more items than this are split at the median without a sweep; 0: never.
  uint32_t presplit_threshold = 0;
  /// Try some thirty positions an axis instead of all legal ones: faster, slightly larger boxes.
  bool coarse = false;
};

/// `quality` (the default: lowest area), `fast`, or `exact` (all clusters of a segment have
/// max_items but one). Throws kInvalidArgument on any other name.
UMBEL_API ClusterConfig cluster_preset(std::string_view name, uint32_t max_items = 128);

struct Clusters {
  std::vector<Range> ranges;     ///< of `items`, one a cluster
  std::vector<uint32_t> items;   ///< a permutation of all item indices, in cluster order
  std::vector<Range> segments;   ///< of `ranges`, one a segment
};

/// Recursive axis-aligned bisection by cost (src/cluster/bisect.cpp). Every item of a segment
/// is in exactly one cluster of that segment; cluster sizes are within [min_items, max_items]
/// with at most one smaller cluster a segment, except that a vertex limit may make more.
/// Deterministic for any thread count. Throws kInvalidArgument or kInvalidMesh (a NaN or
/// infinite box or centroid), kCancelled.
UMBEL_API Clusters build_clusters(const ClusterInput& input, const ClusterConfig& config,
                                  const BuildOptions& options = {});

/// The same for a mesh's triangles.
UMBEL_API Clusters cluster_mesh(const MeshView& mesh, const ClusterConfig& config,
                                float shared_vertex_weight = 0.0f,
                                const BuildOptions& options = {});

/// Runs of `max_items` triangles in Morton order of their centroids: the fastest clusters, with
/// three to four times the area (src/cluster/morton.cpp). Only max_items is used.
UMBEL_API Clusters cluster_mesh_morton(const MeshView& mesh, const ClusterConfig& config,
                                       const BuildOptions& options = {});

/// How good clusters are (src/cluster/metrics.cpp).
struct ClusterMetrics {
  size_t clusters = 0;
  double mean_fill = 0;           ///< items / (clusters * max_items)
  uint32_t min_size = 0, max_size = 0;
  double mean_vertices = 0;       ///< unique vertices a cluster (0 where items have none)
  uint32_t max_vertices = 0;
  double surface_area_ratio = 0;  ///< sum of cluster box areas / area of the box of all
  double sah = 0;                 ///< the same, each weighted by its items
  double overlap = 0;  ///< mean number of cluster boxes that a random line through the box of
                       ///< all pierces (uniform lines: by Crofton the same as the area ratio,
                       ///< but sampled, and so an independent check)
  double ratio_cut = 0;  ///< sum over clusters of cut connection weight / items (Wei & Cheng)
};
UMBEL_API ClusterMetrics cluster_metrics(const ClusterInput& input, const Clusters& clusters,
                                         uint32_t max_items);

}  // namespace umbel
