// A bottom-level structure for each group and set of its clusters that some instance shows. What
// the last frame had is kept.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "group_builder.hpp"

namespace sample {

class TracedGroups {
 public:
  TracedGroups(const Device& device, const Tables& tables)
      : builder_(make_group_builder(device, tables)) {}

  /// Starts a frame: nothing is shown yet.
  void begin();
  /// A number of the structure for these clusters of one group, for `structure` once built.
  uint32_t show(std::span<const uint32_t> clusters);
  /// Builds what the last frame did not have, once the pool has its pages, and forgets what this
  /// frame does not show. Waits for the device.
  void build(const Tables& tables, const PagePool& pool);

  VkDeviceAddress address(uint32_t number) const {
    return shown_[number]->second.structure.address;
  }
  /// Whether a geometry's index is its cluster's number; else it counts from `first_cluster`.
  bool numbers_clusters() const { return builder_->numbers_clusters(); }
  /// Where the clusters of a structure begin in `clusters`.
  uint32_t first_cluster(uint32_t number) const { return shown_[number]->second.first; }
  /// The clusters of all structures, one a geometry.
  const std::vector<uint32_t>& clusters() const { return clusters_; }
  uint32_t built() const { return built_; }
  uint32_t kept() const { return static_cast<uint32_t>(shown_.size()) - built_; }
  uint64_t bytes() const;

 private:
  struct Entry {
    GroupStructure structure;
    uint32_t number = 0, first = 0;
    uint64_t frame = 0;  // that showed it last
  };
  /// Ordered, so that the same frames build the same.
  using Entries = std::map<std::vector<uint32_t>, Entry>;

  std::unique_ptr<GroupBuilder> builder_;
  Entries entries_;
  std::vector<Entries::iterator> shown_;
  std::vector<uint32_t> clusters_;
  uint64_t frame_ = 0;
  uint32_t built_ = 0;
};

}  // namespace sample
