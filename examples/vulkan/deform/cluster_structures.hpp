// A bottom-level structure for each cluster, refitted where the cluster stays and built where it is
// new, and a top level over all.
#pragma once

#include <memory>
#include <vector>

#include "acceleration.hpp"
#include "deform/deforming_clusters.hpp"

namespace sample {

class ClusterStructures {
 public:
  explicit ClusterStructures(const Device& device) : device_(device) {}

  /// After the clusters have changed, or their positions. Waits for the device.
  void follow(DeformingClusters& clusters);
  /// The top level, built anew. Waits for the device.
  void build_scene();

  VkDeviceAddress scene() const { return scene_->address(); }
  uint32_t built() const { return built_; }  ///< the last time
  uint64_t bytes() const;

 private:
  const Device& device_;
  std::vector<std::shared_ptr<AccelerationStructure>> structures_;
  std::unique_ptr<Buffer> instances_;
  std::shared_ptr<AccelerationStructure> scene_;
  uint32_t built_ = 0;
};

}  // namespace sample
