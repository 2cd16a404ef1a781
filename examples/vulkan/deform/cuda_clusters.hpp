// By umbel::cuda, on the device that Vulkan draws with: Vulkan moves the vertices, CUDA clusters
// them, in memory that both have, and each waits for the other's semaphore.
#pragma once

#include <cuda_runtime_api.h>

#include <memory>
#include <umbel/cuda_clusters.hpp>
#include <vector>

#include "deform/growth.hpp"
#include "deform/reclusterer.hpp"

namespace sample {

class CudaClusters : public DeformingClusters {
 public:
  /// Throws Unavailable where CUDA does not have Vulkan's device, or the two cannot share memory.
  CudaClusters(const Device& device, const umbel::Mesh& mesh, uint32_t max_triangles);
  ~CudaClusters() override;
  CudaClusters(const CudaClusters&) = delete;
  CudaClusters& operator=(const CudaClusters&) = delete;

  void deform(float time) override;
  void build() override;
  void refit() override;
  void rebuild_worst(uint32_t clusters) override;

  std::span<const uint32_t> offsets() const override { return offsets_host_; }
  std::span<const umbel::Aabb> boxes() const override { return boxes_host_; }
  umbel::AreaGrowth growth() const override { return growth_.growth(); }
  std::span<const uint32_t> kept() const override { return kept_; }
  uint32_t vertices() const override { return moved_.vertices(); }
  const Buffer& positions() const override { return moved_.positions(); }
  const Buffer& triangles() const override { return triangles_; }
  const Buffer& items() const override { return items_; }
  const Buffer& offsets_buffer() const override { return offsets_; }
  VkSemaphore ready() override;

 private:
  /// A buffer of Vulkan's as CUDA sees it.
  struct Mapped {
    cudaExternalMemory_t memory = nullptr;
    void* pointer = nullptr;
  };
  /// A semaphore that one side signals and the other waits for.
  struct Signal {
    VkSemaphore vulkan = VK_NULL_HANDLE;
    cudaExternalSemaphore_t cuda = nullptr;
  };

  Mapped map(const Buffer& buffer) const;
  Signal make_signal() const;
  template <class T>
  T* allocate(size_t count);
  umbel::cuda::DeviceClusters allocate_clusters();
  umbel::cuda::DeviceMesh mesh() const;
  void wait_for_vulkan();
  /// Runs a function of umbel::cuda with scratch memory.
  template <class Work>
  void run(const Work& work);
  /// Gives Vulkan the clusters, and the host their offsets and boxes.
  void hand_over();

  const Device& device_;
  uint32_t size_;
  umbel::FrameClusterConfig config_;
  uint32_t most_;
  Reclusterer moved_;  ///< for its positions and how they move
  Buffer triangles_, items_, offsets_;
  cudaStream_t stream_ = nullptr;
  Mapped positions_, shared_triangles_, shared_items_;
  Signal has_moved_, has_clustered_;
  std::vector<void*> allocated_;
  void* scratch_ = nullptr;
  size_t scratch_bytes_ = 0;
  uint32_t* source_ = nullptr;
  umbel::cuda::DeviceClusters current_{}, other_{};
  umbel::cuda::DeviceAreaGrowth areas_{}, other_areas_{};
  bool moved_unseen_ = false, clustered_unseen_ = false;
  std::vector<uint32_t> offsets_host_{0}, kept_;
  std::vector<umbel::Aabb> boxes_host_;
  Growth growth_;
};

}  // namespace sample
