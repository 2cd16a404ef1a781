// Clusters of meshes that change every frame: the same triangles, new positions. On the processor
// here, on CUDA devices in cuda_clusters.hpp, with the same bytes.
#pragma once

#include <memory>
#include <span>

#include "umbel/cluster.hpp"
#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel {

enum class FrameMethod : uint32_t {
  kMorton,  ///< runs of triangles in Morton order: the fastest, three to four times the area
  kHybrid,  ///< blocks of the Morton order, bisected by the surface area heuristic
};

struct FrameClusterConfig {
  FrameMethod method = FrameMethod::kHybrid;
  uint32_t max_triangles = 128;  ///< of a cluster, from 1 to 512; with kHybrid from 2
  /// Hybrid only: from 1 to half of max_triangles; 0: a quarter of that. No cluster has fewer,
  /// unless there are fewer triangles in all or a vertex limit cuts it.
  uint32_t min_triangles = 0;
  uint32_t max_vertices = 0;  ///< of a cluster, from 3 to 256; 0: no limit
  float underfill_cost =
      1.0f;  ///< hybrid only, [0, 4]: penalty for triangles missing to full clusters
  /// Bits of Morton codes: 30 or 63; 0: 30 up to 4 million triangles, 63 above. 63 tells more
  /// triangles apart, at some half more sorting.
  uint32_t code_bits = 0;
};

/// Most clusters that `triangles` can give: what arrays must have room for. Throws
/// kInvalidArgument for a value out of range, kUnsupported above 2^31 / 3 triangles.
UMBEL_API uint32_t max_frame_clusters(uint32_t triangles, const FrameClusterConfig& config);

/// How much the areas of clusters have grown since they were built. Areas are relative to the box
/// of all at that time, so that a mesh that is only scaled has no growth.
struct AreaGrowth {
  double area_ratio = 0;           ///< sum of the clusters' box areas over that of the box of all
  double area_ratio_at_build = 0;  ///< the same when each cluster was built
  double growth() const { return area_ratio_at_build > 0 ? area_ratio / area_ratio_at_build : 1; }
};

/// Clusters of one mesh through its frames, on the processor. The triangles and their order are
/// the same bytes for any number of threads, and on a device.
class UMBEL_API FrameClusterer {
 public:
  /// Copies the triangles. Throws as max_frame_clusters does, and kInvalidMesh for an index that
  /// is not below `vertices`.
  FrameClusterer(std::span<const Triangle> triangles, size_t vertices,
                 const FrameClusterConfig& config);
  ~FrameClusterer();
  FrameClusterer(FrameClusterer&&) noexcept;
  FrameClusterer& operator=(FrameClusterer&&) noexcept;

  // Each of these takes one position a vertex, and throws kInvalidArgument for another number of
  // them, kInvalidMesh for a NaN or infinite one that a triangle uses, kCancelled.

  /// Clusters of these positions alone, whatever came before.
  void build(std::span<const Vec3> positions, const BuildOptions& options = {});
  /// The same clusters as `build`, except that triangles with equal codes stay in the order of the
  /// last frame; faster where that order is still nearly right. The first call builds.
  void update(std::span<const Vec3> positions, const BuildOptions& options = {});
  /// Keeps the clusters and recomputes their boxes. The first call builds.
  AreaGrowth refit(std::span<const Vec3> positions, const BuildOptions& options = {});
  /// Refits, and then rebuilds up to `clusters` of those whose areas have grown by the largest
  /// factors; the others come first, in their old order. kInvalidArgument with a vertex limit.
  AreaGrowth rebuild_worst(std::span<const Vec3> positions, uint32_t clusters,
                           const BuildOptions& options = {});

  size_t count() const;                         ///< clusters
  std::span<const uint32_t> items() const;      ///< triangle indices, in cluster order
  std::span<const Triangle> triangles() const;  ///< the same triangles: a new index buffer
  std::span<const uint32_t> offsets() const;    ///< count() + 1: cluster c is [c], [c + 1)
  std::span<const Aabb> boxes() const;          ///< one a cluster
  AreaGrowth area_growth() const;               ///< as last measured

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Clusters of one mesh by FrameMethod::kHybrid, as `cluster_mesh` gives them: faster than that,
/// and nearly as good. Of the config, max_items (from 2 to 512), min_items (at most half of that)
/// and max_vertices are used. Throws as FrameClusterer does.
UMBEL_API Clusters cluster_mesh_hybrid(const MeshView& mesh, const ClusterConfig& config,
                                       const BuildOptions& options = {});

/// Each cluster's own vertices, as mesh shaders and cluster acceleration structures take them.
struct FrameVertexLists {
  std::vector<uint32_t> vertex_offsets;         ///< one more than clusters
  std::vector<uint32_t> vertices;               ///< mesh vertices in the order of use
  std::vector<std::array<uint8_t, 3>> corners;  ///< of each triangle, among its cluster's vertices
};

/// Lists of the current clusters. Throws kInvalidArgument where a cluster has more than 256
/// vertices, which `max_vertices` prevents.
UMBEL_API FrameVertexLists list_frame_vertices(const FrameClusterer& clusters,
                                               const BuildOptions& options = {});

/// When to rebuild the clusters of a moving mesh, by the growth of their areas.
struct RebuildPolicy {
  double threshold = 1.25;    ///< rebuild when the growth of the area ratio reaches this (> 1)
  uint32_t least_period = 1;  ///< frames between two rebuilds, at least
  uint32_t most_period = 0;   ///< frames after which to rebuild in any case; 0: never
  /// Share of the clusters that a rebuild may rebuild, the worst ones; 1 or more: all of them.
  double budget = 1.0;

  enum class Action { kKeep, kRebuild, kRebuildWorst };
  /// What to do in a frame with that growth, `frames` after the last rebuild.
  Action decide(const AreaGrowth& growth, uint32_t frames) const {
    const bool is_due = most_period > 0 && frames >= most_period;
    const bool has_grown = growth.growth() >= threshold && frames >= least_period;
    if (!is_due && !has_grown) return Action::kKeep;
    return budget < 1.0 ? Action::kRebuildWorst : Action::kRebuild;
  }
};

}  // namespace umbel
