// Hierarchies over the clusters of a frame, on CUDA devices: a tree for each cluster, and one over
// the clusters, in the form of one compact tree. Part of the library umbel::cuda.
#pragma once

#include "umbel/cuda_bvh.hpp"
#include "umbel/cuda_clusters.hpp"

namespace umbel::cuda {

/// Builds over the triangles of clusters that build_frame_clusters made with `cluster_config`,
/// behind it in the same stream; nothing waits. Of the mesh, positions and the number of triangles
/// are used; triangles are named by clusters.items, so that refit_bvh follows the mesh.
///
/// `config` names kLbvh, kAtrbvh or kHploc, without presplit. With kLbvh, the binary tree below the
/// nodes has a subtree for every cluster; the others start from that, and may join what lies at the
/// borders of clusters.
UMBEL_API void build_cluster_bvh(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                                 const FrameClusterConfig& cluster_config,
                                 const DeviceClusters& clusters, const DeviceBvhConfig& config,
                                 const DeviceBvh& out, Stream stream = nullptr);

}  // namespace umbel::cuda
