// A bottom-level structure for each group and set of its clusters that some instance shows, each
// cluster a geometry, built straight from the pages in the pool. What the last frame had is kept.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "acceleration.hpp"
#include "page_pool.hpp"
#include "tables.hpp"

namespace sample {

class TracedGroups {
 public:
  explicit TracedGroups(const Device& device) : device_(device) {}

  /// Starts a frame: nothing is shown yet.
  void begin();
  /// A number of the structure for these clusters of one group, for `structure` once built.
  uint32_t show(std::span<const uint32_t> clusters);
  /// Builds what the last frame did not have, after the pool's copies, and forgets what this frame
  /// does not show.
  void record(VkCommandBuffer commands, const Tables& tables, const PagePool& pool);
  /// Call when the device is done.
  void end() { builds_.reset(); }

  const AccelerationStructure& structure(uint32_t number) const {
    return *shown_[number]->second.structure;
  }
  /// Where the clusters of a structure begin in `clusters`.
  uint32_t first_cluster(uint32_t number) const { return shown_[number]->second.first; }
  /// The clusters of all structures, one a geometry.
  const std::vector<uint32_t>& clusters() const { return clusters_; }
  uint32_t built() const { return built_; }
  uint32_t kept() const { return static_cast<uint32_t>(shown_.size()) - built_; }
  uint64_t bytes() const;

 private:
  struct Entry {
    std::shared_ptr<AccelerationStructure> structure;
    uint32_t number = 0, first = 0;
    uint64_t frame = 0;  // that showed it last
  };
  /// Ordered, so that the same frames build the same.
  using Entries = std::map<std::vector<uint32_t>, Entry>;

  const Device& device_;
  Entries entries_;
  std::vector<Entries::iterator> shown_;
  std::vector<uint32_t> clusters_;
  std::vector<StructureInput> inputs_;
  std::unique_ptr<StructureBuilds> builds_;
  uint64_t frame_ = 0;
  uint32_t built_ = 0;
};

}  // namespace sample
