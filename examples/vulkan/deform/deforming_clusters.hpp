// Clusters of a mesh that changes every frame, whoever makes them: compute shaders
// (reclusterer.hpp) or CUDA (cuda_clusters.hpp). The same triangles, order and boxes as
// umbel::FrameClusterer's by kMorton.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <umbel/umbel.hpp>

#include "memory.hpp"

namespace sample {

class DeformingClusters {
 public:
  virtual ~DeformingClusters() = default;

  /// Moves the vertices to where they are at a time from 0 to 1.
  virtual void deform(float time) = 0;
  /// Clusters of these positions alone, whatever came before.
  virtual void build() = 0;
  /// The clusters stay; their boxes follow.
  virtual void refit() = 0;
  /// Refits, and then rebuilds up to `clusters` of those that have grown by the largest factors;
  /// the others come first, in their old order.
  virtual void rebuild_worst(uint32_t clusters) = 0;

  /// One more than clusters; one alone before the first build.
  virtual std::span<const uint32_t> offsets() const = 0;
  virtual std::span<const umbel::Aabb> boxes() const = 0;
  virtual umbel::AreaGrowth growth() const = 0;
  /// How many of the first clusters are those of the last frame, which had these numbers.
  virtual std::span<const uint32_t> kept() const = 0;
  uint32_t count() const { return static_cast<uint32_t>(offsets().size()) - 1; }

  virtual uint32_t vertices() const = 0;
  virtual const Buffer& positions() const = 0;
  virtual const Buffer& triangles() const = 0;  ///< in cluster order
  virtual const Buffer& items() const = 0;
  virtual const Buffer& offsets_buffer() const = 0;
  /// What the next commands that read clusters must wait for, once; null where there is nothing.
  virtual VkSemaphore ready() { return VK_NULL_HANDLE; }
};

/// By CUDA where this was built with it and the device is one of its, else by compute shaders.
std::unique_ptr<DeformingClusters> make_clusters(const Device& device, const umbel::Mesh& mesh,
                                                 uint32_t max_triangles);

}  // namespace sample
