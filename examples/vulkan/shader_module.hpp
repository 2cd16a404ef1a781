// What pipelines of any kind are made of: a compiled shader while one is made, and the layout that
// all share, of push constants alone.
#pragma once

#include <cstdint>
#include <span>

#include "device.hpp"
#include "layouts.hpp"

namespace sample {

class ShaderModule {
 public:
  ShaderModule(const Device& device, std::span<const uint32_t> words) : device_(device) {
    const VkShaderModuleCreateInfo info{.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
                                        .codeSize = words.size_bytes(),
                                        .pCode = words.data()};
    check(vkCreateShaderModule(device.handle(), &info, nullptr, &module_), "a shader");
  }
  ~ShaderModule() { vkDestroyShaderModule(device_.handle(), module_, nullptr); }
  ShaderModule(const ShaderModule&) = delete;
  ShaderModule& operator=(const ShaderModule&) = delete;
  VkPipelineShaderStageCreateInfo stage(VkShaderStageFlagBits stage) const {
    return {.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
            .stage = stage,
            .module = module_,
            .pName = "main"};
  }

 private:
  const Device& device_;
  VkShaderModule module_ = VK_NULL_HANDLE;
};

inline VkPipelineLayout make_layout(const Device& device, uint32_t push_bytes = kPushBytes) {
  const VkPushConstantRange push{.stageFlags = VK_SHADER_STAGE_ALL, .size = push_bytes};
  const VkPipelineLayoutCreateInfo info{.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                        .pushConstantRangeCount = 1,
                                        .pPushConstantRanges = &push};
  VkPipelineLayout layout = VK_NULL_HANDLE;
  check(vkCreatePipelineLayout(device.handle(), &info, nullptr, &layout), "a layout");
  return layout;
}

}  // namespace sample
