// Groups by VK_NV_cluster_acceleration_structure: each cluster is a structure of its own, built
// once and kept while any set has it; a set's structure only lists them. Compiled everywhere, used
// where a device has the extension.
#pragma once

#include <map>

#include "group_builder.hpp"

namespace sample {

class ClusterGroups : public GroupBuilder {
 public:
  /// The device must have the extension.
  ClusterGroups(const Device& device, const Tables& tables);
  /// Whether the device's clusters may be as large as these.
  static bool fits(const Device& device, const Tables& tables);
  std::vector<GroupStructure> build(std::span<const std::vector<uint32_t>> sets,
                                    const Tables& tables, const PagePool& pool) override;
  bool numbers_clusters() const override { return true; }

 private:
  struct Cluster {
    VkDeviceAddress address;
    std::shared_ptr<const Buffer> storage;
  };
  /// What a command has built: where each is, and the buffer that all lie in.
  struct Built {
    std::vector<VkDeviceAddress> addresses;
    std::shared_ptr<const Buffer> storage;
  };
  using Kept = std::vector<std::shared_ptr<const Cluster>>;

  Built run(const VkClusterAccelerationStructureInputInfoNV& input,
            std::span<const std::byte> infos, uint64_t alignment) const;
  /// Those of all sets, in their order; builds what is not there yet.
  std::vector<Kept> clusters_of(std::span<const std::vector<uint32_t>> sets, const Tables& tables,
                                const PagePool& pool);

  const Device& device_;
  VkPhysicalDeviceClusterAccelerationStructurePropertiesNV limits_;
  std::map<uint32_t, std::weak_ptr<const Cluster>> known_;
};

}  // namespace sample
