// Clusters of a mesh that changes every frame, by Vulkan's compute alone, so on any vendor's
// device: runs of triangles in the order of their Morton codes (Morton, "A computer oriented
// geodetic data base", 1966). The same triangles, order and boxes as umbel::FrameClusterer's by
// kMorton.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <umbel/umbel.hpp>
#include <vector>

#include "deform/compute.hpp"
#include "deform/deforming_clusters.hpp"
#include "deform/growth.hpp"
#include "deform/layouts.hpp"
#include "memory.hpp"

namespace sample {

class Reclusterer : public DeformingClusters {
 public:
  /// Up to four million triangles, as 30-bit codes tell apart; throws for more, or for none.
  /// `positions`: where they are, kShared if CUDA clusters them.
  Reclusterer(const Device& device, const umbel::Mesh& mesh, uint32_t max_triangles,
              Place positions = Place::kDevice);

  void deform(float time) override;
  void deform(float time, VkSemaphore signal);
  void build() override;
  void refit() override;
  void rebuild_worst(uint32_t clusters) override;

  std::span<const uint32_t> offsets() const override { return offsets_host_; }
  std::span<const umbel::Aabb> boxes() const override {
    return boxes_.mapped<umbel::Aabb>().first(count());
  }
  umbel::AreaGrowth growth() const override { return growth_.growth(); }
  std::span<const uint32_t> kept() const override { return kept_; }
  uint32_t vertices() const override { return vertices_; }
  const Buffer& positions() const override { return positions_; }
  const Buffer& triangles() const override { return *triangles_; }
  const Buffer& items() const override { return *items_; }
  const Buffer& offsets_buffer() const override { return offsets_; }

 private:
  /// Clusters the triangles from `first` on, which `from` has, into `triangles_` and `items_`.
  void sort_into_runs(const Buffer& from, const Buffer& from_items, uint32_t first, uint32_t count);
  void write_mesh(const Buffer& from, const Buffer& from_items);
  void write_offsets();
  void find_boxes();
  GpuMeshPush push(uint32_t first, uint32_t count, uint32_t pass = 0) const;

  const Device& device_;
  uint32_t max_triangles_, vertices_, size_;
  float extent_, time_ = 0;
  Compute deform_, center_bounds_, codes_, radix_count_, radix_scan_, radix_scatter_, write_,
      cluster_boxes_;
  Buffer rest_, positions_, source_, source_items_, keys_[2], values_[2], counts_, bounds_, grid_,
      offsets_, boxes_, mesh_;
  /// The clusters' triangles; the others are where those that are rebuilt are gathered.
  std::unique_ptr<Buffer> triangles_, items_, other_triangles_, other_items_;
  std::vector<uint32_t> offsets_host_{0}, kept_;
  Growth growth_;
};

}  // namespace sample
