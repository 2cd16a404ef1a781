// Acceleration structures: sizes, storage, and builds that share one scratch buffer.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "memory.hpp"

namespace sample {

/// A built structure. Those built together share storage, which lives as long as any of them.
class AccelerationStructure {
 public:
  AccelerationStructure(const Device& device, VkAccelerationStructureTypeKHR type,
                        std::shared_ptr<const Buffer> storage, uint64_t offset, uint64_t bytes);
  ~AccelerationStructure();
  AccelerationStructure(const AccelerationStructure&) = delete;
  AccelerationStructure& operator=(const AccelerationStructure&) = delete;
  VkAccelerationStructureKHR handle() const { return handle_; }
  VkDeviceAddress address() const { return address_; }
  uint64_t bytes() const { return bytes_; }

 private:
  const Device& device_;
  std::shared_ptr<const Buffer> storage_;
  uint64_t bytes_;
  VkAccelerationStructureKHR handle_ = VK_NULL_HANDLE;
  VkDeviceAddress address_ = 0;
};

/// One structure to be built: its geometries, and how many primitives each has. Or one that is
/// there already, to be refitted to the same geometries where their vertices have moved.
struct StructureInput {
  std::vector<VkAccelerationStructureGeometryKHR> geometries;
  std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
  std::shared_ptr<AccelerationStructure> refitted{};
};

/// Builds structures of one type. `record` may be called once, after all others are done.
class StructureBuilds {
 public:
  /// Makes the structures, empty so far. The inputs must live until `record`. Structures that are
  /// refitted later need the flag for updates.
  StructureBuilds(const Device& device, VkAccelerationStructureTypeKHR type,
                  std::span<const StructureInput> inputs,
                  VkBuildAccelerationStructureFlagsKHR flags =
                      VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR);
  /// Each waits for no other: they run side by side on the device.
  void record(VkCommandBuffer commands) const;
  /// In the order of the inputs.
  const std::vector<std::shared_ptr<AccelerationStructure>>& structures() const {
    return structures_;
  }

 private:
  std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos_;
  std::vector<const VkAccelerationStructureBuildRangeInfoKHR*> ranges_;
  std::vector<std::shared_ptr<AccelerationStructure>> structures_;
  std::unique_ptr<Buffer> scratch_;
};

}  // namespace sample
