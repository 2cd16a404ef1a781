// The ray tracing pipeline: ray generation, one miss and one hit shader, and the table of them.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "memory.hpp"

namespace sample {

class RayPipeline {
 public:
  /// `hit` says what a ray finds. Throws Unavailable where the device has no such pipeline.
  RayPipeline(const Device& device, std::span<const uint32_t> hit);
  ~RayPipeline();
  RayPipeline(const RayPipeline&) = delete;
  RayPipeline& operator=(const RayPipeline&) = delete;

  /// A ray for each pixel. `push` is a GpuPush.
  void record(VkCommandBuffer commands, const void* push, uint32_t width, uint32_t height) const;

 private:
  void make_table();

  const Device& device_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  std::unique_ptr<Buffer> table_;
  uint64_t entry_bytes_ = 0;
};

}  // namespace sample
