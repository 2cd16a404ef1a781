// Clusters of meshes that change every frame, on CUDA devices: with the same bytes as on the
// processor (frame_clusters.hpp). cuda_types.hpp says what holds of pointers, streams, scratch
// memory and errors. NaN and infinite positions give clusters of some order, each triangle in one
// of them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "umbel/cuda_types.hpp"
#include "umbel/frame_clusters.hpp"

namespace umbel::cuda {

/// Clusters of a frame. Cluster c has triangles [offsets[c], offsets[c + 1]).
struct DeviceClusters {
  uint32_t* items;    ///< one a triangle: their names, in cluster order
  uint32_t* indices;  ///< three a triangle: the index buffer in cluster order
  uint32_t* offsets;  ///< room for max_frame_clusters(...) + 1
  Aabb* boxes;        ///< room for max_frame_clusters(...)
  uint32_t* count;    ///< one: how many clusters there are
};

/// Areas of clusters: shares of that of the box of all, times 2^40; what is infinite has all of it.
struct DeviceAreaGrowth {
  uint64_t* now;       ///< room for max_frame_clusters(...)
  uint64_t* at_build;  ///< the same
  uint64_t* total;     ///< two: the sum of `now` and the sum of `at_build`
};

/// The sums of DeviceAreaGrowth::total, once they have been copied to the host.
inline AreaGrowth area_growth_of(const uint64_t total[2]) {
  constexpr double kWhole = double(uint64_t(1) << 40);
  return {double(total[0]) / kWhole, double(total[1]) / kWhole};
}

/// Clusters of the mesh's positions. For frames after the first, mesh.indices and mesh.items may be
/// those of the last frame's clusters (`out` must be other arrays): triangles with equal codes then
/// keep the last frame's order, and reading in cluster order is faster.
UMBEL_API void build_frame_clusters(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                                    const FrameClusterConfig& config, const DeviceClusters& out,
                                    Stream stream = nullptr);

/// Measures clusters by their boxes; with `is_new`, which follows a build, this is what later
/// measures are compared with.
UMBEL_API void measure_frame_clusters(void* scratch, size_t& scratch_bytes, uint32_t triangles,
                                      const FrameClusterConfig& config,
                                      const DeviceClusters& clusters,
                                      const DeviceAreaGrowth& growth, bool is_new,
                                      Stream stream = nullptr);

/// Recomputes the boxes of clusters for new positions, and measures. Of the mesh, only the
/// positions and the number of triangles are used.
UMBEL_API void refit_frame_clusters(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                                    const FrameClusterConfig& config,
                                    const DeviceClusters& clusters, const DeviceAreaGrowth& growth,
                                    Stream stream = nullptr);

/// After a refit, rebuilds up to `budget` of the clusters whose areas have grown by the largest
/// factors since they were built; the others come first, in their old order. `out` and `out_growth`
/// are other arrays, but growth.now and growth.total may be shared. The config has no vertex limit.
UMBEL_API void rebuild_worst_frame_clusters(
    void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh, const FrameClusterConfig& config,
    uint32_t budget, const DeviceClusters& clusters, const DeviceAreaGrowth& growth,
    const DeviceClusters& out, const DeviceAreaGrowth& out_growth, Stream stream = nullptr);

/// Vertices of each cluster's own, as mesh shaders and cluster acceleration structures take them.
struct DeviceVertexLists {
  uint32_t* offsets;   ///< room for max_frame_clusters(...) + 1
  uint32_t* vertices;  ///< room for three a triangle
  uint8_t* corners;    ///< three a triangle: its corners among its cluster's vertices
};

/// The config has a vertex limit, or clusters of at most 85 triangles, which have not more than
/// 255.
UMBEL_API void list_frame_vertices(void* scratch, size_t& scratch_bytes, uint32_t triangles,
                                   const FrameClusterConfig& config, const DeviceClusters& clusters,
                                   const DeviceVertexLists& out, Stream stream = nullptr);

}  // namespace umbel::cuda
