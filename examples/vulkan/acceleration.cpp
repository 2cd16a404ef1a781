#include "acceleration.hpp"

#include <algorithm>

namespace sample {

namespace {

constexpr uint64_t kStructureAlignment = 256;  // of a structure in its buffer, by the specification

uint64_t aligned(uint64_t bytes, uint64_t to) { return (bytes + to - 1) / to * to; }

}  // namespace

AccelerationStructure::AccelerationStructure(const Device& device,
                                             VkAccelerationStructureTypeKHR type,
                                             std::shared_ptr<const Buffer> storage, uint64_t offset,
                                             uint64_t bytes)
    : device_(device), storage_(std::move(storage)), bytes_(bytes) {
  const VkAccelerationStructureCreateInfoKHR info{
      .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR,
      .buffer = storage_->handle(),
      .offset = offset,
      .size = bytes,
      .type = type};
  check(vkCreateAccelerationStructureKHR(device.handle(), &info, nullptr, &handle_),
        "an acceleration structure");
  const VkAccelerationStructureDeviceAddressInfoKHR where{
      .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR,
      .accelerationStructure = handle_};
  address_ = vkGetAccelerationStructureDeviceAddressKHR(device.handle(), &where);
}

AccelerationStructure::~AccelerationStructure() {
  vkDestroyAccelerationStructureKHR(device_.handle(), handle_, nullptr);
}

StructureBuilds::StructureBuilds(const Device& device, VkAccelerationStructureTypeKHR type,
                                 std::span<const StructureInput> inputs,
                                 VkBuildAccelerationStructureFlagsKHR flags) {
  if (inputs.empty()) return;
  const uint64_t scratch_alignment = device.ray_limits().scratch_alignment;
  std::vector<uint64_t> offsets, sizes, scratch_offsets;
  uint64_t storage_bytes = 0, scratch_bytes = 0;
  for (const StructureInput& input : inputs) {
    infos_.push_back({.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
                      .type = type,
                      .flags = flags,
                      .mode = input.refitted ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                                             : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                      .geometryCount = static_cast<uint32_t>(input.geometries.size()),
                      .pGeometries = input.geometries.data()});
    ranges_.push_back(input.ranges.data());
    std::vector<uint32_t> counts;
    for (const auto& range : input.ranges) counts.push_back(range.primitiveCount);
    VkAccelerationStructureBuildSizesInfoKHR needs{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    vkGetAccelerationStructureBuildSizesKHR(device.handle(),
                                            VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                            &infos_.back(), counts.data(), &needs);
    offsets.push_back(storage_bytes);
    sizes.push_back(needs.accelerationStructureSize);
    scratch_offsets.push_back(scratch_bytes);
    if (!input.refitted) {
      storage_bytes += aligned(needs.accelerationStructureSize, kStructureAlignment);
    }
    scratch_bytes += aligned(input.refitted ? needs.updateScratchSize : needs.buildScratchSize,
                             scratch_alignment);
  }
  const auto storage = storage_bytes == 0
                           ? nullptr
                           : std::make_shared<const Buffer>(device, storage_bytes, Place::kDevice);
  scratch_ = std::make_unique<Buffer>(device, scratch_bytes + scratch_alignment, Place::kDevice);
  const VkDeviceAddress scratch = aligned(scratch_->address(), scratch_alignment);
  for (size_t i = 0; i < infos_.size(); ++i) {
    structures_.push_back(inputs[i].refitted ? inputs[i].refitted
                                             : std::make_shared<AccelerationStructure>(
                                                   device, type, storage, offsets[i], sizes[i]));
    if (inputs[i].refitted) infos_[i].srcAccelerationStructure = structures_[i]->handle();
    infos_[i].dstAccelerationStructure = structures_[i]->handle();
    infos_[i].scratchData.deviceAddress = scratch + scratch_offsets[i];
  }
}

void StructureBuilds::record(VkCommandBuffer commands) const {
  if (infos_.empty()) return;
  vkCmdBuildAccelerationStructuresKHR(commands, static_cast<uint32_t>(infos_.size()), infos_.data(),
                                      ranges_.data());
}

}  // namespace sample
