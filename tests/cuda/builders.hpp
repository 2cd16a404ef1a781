// Trees that the processor builds, for tests of those that a device builds.
#pragma once

#include <vector>

#include "umbel/cuda_cluster_bvh.hpp"

namespace umbel::cuda {

/// A tree in the memory of the processor.
struct BuiltBvh {
  std::vector<bvh::CompactNode> nodes;  ///< those that are used
  std::vector<bvh::CompactTriangle> triangles;
  bvh::CompactInfo info;
};

/// On the processor: CUDA's compiler would compile its lambdas for the device only.
BuiltBvh build_on_processor(const Mesh& mesh, const DeviceBvhConfig& config);

/// Over clusters that the processor made.
BuiltBvh build_cluster_bvh_on_processor(const Mesh& mesh, const FrameClusterer& clusters,
                                        const FrameClusterConfig& of_clusters,
                                        const DeviceBvhConfig& config);

/// With all boxes for these positions.
BuiltBvh refit_on_processor(BuiltBvh tree, const Mesh& mesh);

}  // namespace umbel::cuda
