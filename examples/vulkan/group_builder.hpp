// Builds a bottom-level structure for each of some sets of clusters, each of one group.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "page_pool.hpp"
#include "tables.hpp"

namespace sample {

struct GroupStructure {
  VkDeviceAddress address = 0;
  uint64_t bytes = 0;
  std::shared_ptr<const void> keeps;  ///< what it lies in
};

class GroupBuilder {
 public:
  virtual ~GroupBuilder() = default;
  /// One for each set, straight from the pages in the pool. Waits until all are built.
  virtual std::vector<GroupStructure> build(std::span<const std::vector<uint32_t>> sets,
                                            const Tables& tables, const PagePool& pool) = 0;
  /// Whether a geometry's index is its cluster's number; else its place in its set.
  virtual bool numbers_clusters() const = 0;
};

/// The one that suits the device: by VK_NV_cluster_acceleration_structure where it is, and takes
/// clusters as large as these; else by VK_KHR_acceleration_structure.
std::unique_ptr<GroupBuilder> make_group_builder(const Device& device, const Tables& tables);

}  // namespace sample
