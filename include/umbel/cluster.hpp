// Spatial clusters of any items that have boxes: triangles, or clusters themselves.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// Weighted adjacency between items: item i is connected to
/// targets[ranges[i].offset .. + count) with those weights. Should be symmetric.
struct Connections {
  std::span<const Range> ranges;  ///< one an item, or empty: no connections
  std::span<const uint32_t> targets;
  std::span<const float> weights;  ///< >= 0, one a target, or empty: all 1; with vertex_bits all 0
  /// One a target, or empty. Bit k is set where vertex k of item i is one of the target's as well.
  /// With ClusterInput::vertices_per_item, from 1 to 8, they stand for `item_vertices` where
  /// vertices have no indices: ClusterConfig::max_vertices then counts by them. All pairs of items
  /// that share a vertex must be connected, in both directions.
  std::span<const uint8_t> vertex_bits = {};
};

struct ClusterInput {
  std::span<const Aabb> boxes;
  std::span<const Vec3> centroids;  ///< one an item, or empty: the boxes' centres
  Connections connections;
  /// Vertex indices of each item, `vertices_per_item` apiece (3 for triangles), or empty.
  /// ClusterConfig::max_vertices needs these, or Connections::vertex_bits.
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
  uint32_t min_items = 64;             ///< >= 1, <= max_items
  uint32_t max_items = 128;            ///< >= 1
  uint32_t max_vertices = 0;           ///< most unique vertices a cluster; 0: no limit
  float underfill_cost = 0.5f;         ///< [0, 1]: penalty for items missing to full clusters
  float overlap_cost = 0.0f;           ///< [0, 1]: penalty for overlap of the two sides
  float vertex_underfill_cost = 0.5f;  ///< [0, 1]: penalty for too few vertices
  /// Nodes with more items than this are split at the median without a sweep; 0: never.
  uint32_t presplit_threshold = 0;
  /// Split by groups of neighbours and at few positions instead of all legal ones: about twice as
  /// fast, with boxes a seventh larger and a little less full clusters.
  bool coarse = false;
};

/// `quality` (the default: lowest area), `fast`, or `exact` (all clusters of a segment have
/// max_items but one). Throws kInvalidArgument on any other name.
UMBEL_API ClusterConfig cluster_preset(std::string_view name, uint32_t max_items = 128);

struct Clusters {
  std::vector<Range> ranges;    ///< of `items`, one a cluster
  std::vector<uint32_t> items;  ///< a permutation of all item indices, in cluster order
  std::vector<Range> segments;  ///< of `ranges`, one a segment
};

/// Recursive axis-aligned bisection by cost. Every item of a segment
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
/// three to four times the area. Only max_items is used.
UMBEL_API Clusters cluster_mesh_morton(const MeshView& mesh, const ClusterConfig& config,
                                       const BuildOptions& options = {});

/// Most vertices and triangles of a cluster that order_clusters and cluster_bounds can take:
/// meshoptimizer's limits. ClusterConfig::max_vertices and max_items keep them.
inline constexpr uint32_t kMaxMeshletVertices = 256, kMaxMeshletTriangles = 512;

/// Clusters as mesh shaders, rasterisers and cluster acceleration structures take them: each with
/// vertices and byte-sized indices of its own.
struct ClusterMeshlets {
  /// Clusters::items with the triangles of each cluster in their new order; the clusters' ranges
  /// hold as they are.
  std::vector<uint32_t> items;
  /// Cluster c has vertices[vertex_offsets[c] .. vertex_offsets[c + 1]); one more than clusters.
  std::vector<uint32_t> vertex_offsets;
  std::vector<uint32_t> vertices;  ///< mesh vertices, in the order in which triangles use them
  /// Corners of triangle items[i], as indices into its cluster's vertices; zero where items[i] is
  /// in no cluster. One an item.
  std::vector<std::array<uint8_t, 3>> corners;
};

/// Orders the triangles and vertices of each cluster for vertex reuse and rasterisation, with
/// meshoptimizer's meshlet optimiser. At `level` 0 triangles keep their
/// corner order; levels 1 to 9 try harder to make what is stored compress well (3 is a good value),
/// and may rotate corners. Every triangle stays in its cluster. Deterministic for any thread count.
/// Throws kInvalidArgument for a cluster of more than kMaxMeshletVertices or kMaxMeshletTriangles,
/// or one that is not of this mesh; kInvalidMesh for an index out of range; kCancelled;
/// kUnsupported for a level above 0 where Umbel was built with a meshoptimizer before 1.2.
UMBEL_API ClusterMeshlets order_clusters(const MeshView& mesh, const Clusters& clusters,
                                         int level = 0, const BuildOptions& options = {});

/// Bounds for culling a cluster. With e the eye: the cluster is outside a frustum that misses
/// `sphere`, and no triangle's front is visible where
///   dot(normalize(cone_apex - e), cone_axis) >= cone_cutoff   or, without the apex,
///   dot(center - e, cone_axis) >= cone_cutoff * length(center - e) + radius.
struct ClusterBounds {
  Sphere sphere;      ///< contains all the cluster's triangles
  Vec3 cone_apex;     ///< behind every triangle
  Vec3 cone_axis;     ///< unit length: where the triangles face; zero if there is no such cone
  float cone_cutoff;  ///< sine of the cone's half angle, and a little; 1 if there is no cone
  bool operator==(const ClusterBounds&) const = default;
};

/// Bounding sphere and normal cone of each cluster, with meshoptimizer's bounds as a start and
/// rounded so that they hold for any mesh, however far from
/// the origin, however large or small. Triangles without area are in the sphere, but not in the
/// cone. Deterministic for any thread count.
/// Throws as order_clusters does, and kInvalidMesh for a NaN or infinite position.
UMBEL_API std::vector<ClusterBounds> cluster_bounds(const MeshView& mesh, const Clusters& clusters,
                                                    const BuildOptions& options = {});

/// How good clusters are.
struct ClusterMetrics {
  size_t clusters = 0;
  double mean_fill = 0;  ///< items / (clusters * max_items)
  uint32_t min_size = 0, max_size = 0;
  double mean_vertices = 0;  ///< unique vertices a cluster (0 where items have none)
  uint32_t max_vertices = 0;
  double surface_area_ratio = 0;  ///< sum of cluster box areas / area of the box of all
  double sah = 0;                 ///< the same, each weighted by its items
  double overlap = 0;    ///< mean number of cluster boxes that a random line through the box of
                         ///< all pierces (uniform lines: by Crofton the same as the area ratio,
                         ///< but sampled, and so an independent check)
  double ratio_cut = 0;  ///< sum over clusters of cut connection weight / items (Wei & Cheng)
};
UMBEL_API ClusterMetrics cluster_metrics(const ClusterInput& input, const Clusters& clusters,
                                         uint32_t max_items);

}  // namespace umbel
