#include "ray_pipeline.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "layouts.hpp"
#include "shader_module.hpp"
#include "unavailable.hpp"

namespace sample {

namespace {

// Compiled by CMake: an array of words each.
#include "trace.rgen.h"
#include "trace.rmiss.h"

constexpr uint32_t kGroups = 3;  // ray generation, miss, hit

constexpr VkRayTracingShaderGroupCreateInfoKHR group(VkRayTracingShaderGroupTypeKHR type,
                                                     uint32_t general, uint32_t hit) {
  return {.sType = VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR,
          .type = type,
          .generalShader = general,
          .closestHitShader = hit,
          .anyHitShader = VK_SHADER_UNUSED_KHR,
          .intersectionShader = VK_SHADER_UNUSED_KHR};
}

}  // namespace

RayPipeline::RayPipeline(const Device& device, std::span<const uint32_t> hit_shader)
    : device_(device) {
  if (!device.ray_tracing()) throw Unavailable("the device has no ray tracing pipeline.");
  layout_ = make_layout(device);
  const ShaderModule generate(device, trace_rgen), miss(device, trace_rmiss),
      hit(device, hit_shader);
  const std::array stages = {generate.stage(VK_SHADER_STAGE_RAYGEN_BIT_KHR),
                             miss.stage(VK_SHADER_STAGE_MISS_BIT_KHR),
                             hit.stage(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR)};
  constexpr std::array groups = {
      group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, 0, VK_SHADER_UNUSED_KHR),
      group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, 1, VK_SHADER_UNUSED_KHR),
      group(VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR, VK_SHADER_UNUSED_KHR, 2)};
  static_assert(groups.size() == kGroups);
  const VkRayTracingPipelineClusterAccelerationStructureCreateInfoNV clusters{
      .sType = VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CLUSTER_ACCELERATION_STRUCTURE_CREATE_INFO_NV,
      .allowClusterAccelerationStructure = VK_TRUE};
  const VkRayTracingPipelineCreateInfoKHR info{
      .sType = VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR,
      .pNext = device.cluster_structures() ? &clusters : nullptr,
      .stageCount = stages.size(),
      .pStages = stages.data(),
      .groupCount = kGroups,
      .pGroups = groups.data(),
      .maxPipelineRayRecursionDepth = 1,
      .layout = layout_};
  check(vkCreateRayTracingPipelinesKHR(device.handle(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info,
                                       nullptr, &pipeline_),
        "the ray tracing pipeline");
  make_table();
}

RayPipeline::~RayPipeline() {
  vkDestroyPipeline(device_.handle(), pipeline_, nullptr);
  vkDestroyPipelineLayout(device_.handle(), layout_, nullptr);
}

// Each group's handle at an address of its own alignment.
void RayPipeline::make_table() {
  const RayLimits limits = device_.ray_limits();
  const uint64_t alignment = limits.handle_alignment;
  entry_bytes_ = (limits.handle_bytes + alignment - 1) / alignment * alignment;
  std::vector<std::byte> handles(kGroups * size_t{limits.handle_bytes});
  check(vkGetRayTracingShaderGroupHandlesKHR(device_.handle(), pipeline_, 0, kGroups,
                                             handles.size(), handles.data()),
        "the shaders' handles");
  table_ = std::make_unique<Buffer>(device_, kGroups * entry_bytes_ + alignment, Place::kHost);
  const uint64_t start = (alignment - table_->address() % alignment) % alignment;
  for (uint32_t g = 0; g < kGroups; ++g) {
    std::memcpy(&table_->mapped<std::byte>()[start + g * entry_bytes_],
                &handles[g * size_t{limits.handle_bytes}], limits.handle_bytes);
  }
}

void RayPipeline::record(VkCommandBuffer commands, const void* push, uint32_t width,
                         uint32_t height) const {
  const uint64_t alignment = device_.ray_limits().handle_alignment;
  const VkDeviceAddress first = (table_->address() + alignment - 1) / alignment * alignment;
  const auto region = [&](uint32_t g) {
    return VkStridedDeviceAddressRegionKHR{first + g * entry_bytes_, entry_bytes_, entry_bytes_};
  };
  const VkStridedDeviceAddressRegionKHR generate = region(0), miss = region(1), hit = region(2),
                                        none{};
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_);
  vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_ALL, 0, kPushBytes, push);
  vkCmdTraceRaysKHR(commands, &generate, &miss, &hit, &none, width, height, 1);
}

}  // namespace sample
