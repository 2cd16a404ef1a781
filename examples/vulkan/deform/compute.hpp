// A compute pipeline with push constants of its own.
#pragma once

#include <cstdint>
#include <span>

#include "device.hpp"

namespace sample {

class Compute {
 public:
  Compute(const Device& device, std::span<const uint32_t> shader, uint32_t push_bytes);
  ~Compute();
  Compute(const Compute&) = delete;
  Compute& operator=(const Compute&) = delete;

  /// So many workgroups, after all writes before; what follows waits for its own.
  void record(VkCommandBuffer commands, const void* push, uint32_t groups) const;

 private:
  const Device& device_;
  uint32_t push_bytes_;
  VkPipelineLayout layout_;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
};

}  // namespace sample
