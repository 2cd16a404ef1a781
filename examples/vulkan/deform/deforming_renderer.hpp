// A frame of a deforming mesh: deform, cluster by a policy, structures, rays; with the time of
// each.
#pragma once

#include <umbel/umbel.hpp>

#include "deform/cluster_structures.hpp"
#include "deform/deforming_clusters.hpp"
#include "frame.hpp"
#include "ray_pipeline.hpp"

namespace sample {

/// Milliseconds of a frame, each until the device is done.
struct DeformTimes {
  double deform = 0, clusters = 0, structures = 0, scene = 0, trace = 0;
  double all() const { return deform + clusters + structures + scene + trace; }
};

struct DeformReport {
  DeformTimes times;
  umbel::AreaGrowth growth;
  umbel::RebuildPolicy::Action action = umbel::RebuildPolicy::Action::kKeep;
  uint32_t clusters = 0, built = 0;  ///< structures built; the others are refitted
  uint64_t structure_bytes = 0;
};

class DeformingRenderer {
 public:
  /// Throws Unavailable for a device without ray tracing.
  DeformingRenderer(const Device& device, const umbel::Mesh& mesh, uint32_t max_triangles,
                    uint32_t width, uint32_t height);

  /// The mesh at a time from 0 to 1, clustered as `policy` says; the first frame builds.
  DeformReport draw(float time, const umbel::RebuildPolicy& policy, const FrameInput& input);
  std::span<const uint8_t> pixels() const { return readback_.mapped<uint8_t>(); }
  const DeformingClusters& clusters() const { return *clusters_; }

 private:
  umbel::RebuildPolicy::Action cluster(const umbel::RebuildPolicy& policy);
  void write_frame(const FrameInput& input) const;

  const Device& device_;
  uint32_t width_, height_;
  RayPipeline pipeline_;
  std::unique_ptr<DeformingClusters> clusters_;
  ClusterStructures structures_;
  Buffer frame_, rays_, traced_, readback_;
  uint32_t frames_since_ = 0;
};

}  // namespace sample
