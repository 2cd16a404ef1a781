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
#include "deform/growth.hpp"
#include "deform/layouts.hpp"
#include "memory.hpp"

namespace sample {

class Reclusterer {
 public:
  /// Up to four million triangles, as 30-bit codes tell apart; throws for more, or for none.
  Reclusterer(const Device& device, const umbel::Mesh& mesh, uint32_t max_triangles);

  /// Moves the vertices to where they are at a time from 0 to 1.
  void deform(float time);
  /// Clusters of these positions alone, whatever came before.
  void build();
  /// The clusters stay; their boxes follow.
  void refit();
  /// Refits, and then rebuilds up to `clusters` of those that have grown by the largest factors;
  /// the others come first, in their old order.
  void rebuild_worst(uint32_t clusters);

  uint32_t count() const { return static_cast<uint32_t>(offsets_host_.size()) - 1; }
  std::span<const uint32_t> offsets() const { return offsets_host_; }
  std::span<const umbel::Aabb> boxes() const { return boxes_.mapped<umbel::Aabb>().first(count()); }
  umbel::AreaGrowth growth() const { return growth_.growth(); }
  /// How many of the first clusters are those of the last frame, which had these numbers.
  std::span<const uint32_t> kept() const { return kept_; }

  uint32_t vertices() const { return vertices_; }
  const Buffer& positions() const { return positions_; }
  const Buffer& triangles() const { return *triangles_; }
  const Buffer& items() const { return *items_; }
  const Buffer& offsets_buffer() const { return offsets_; }

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
