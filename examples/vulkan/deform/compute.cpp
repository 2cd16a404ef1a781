#include "deform/compute.hpp"

#include "shader_module.hpp"

namespace sample {

Compute::Compute(const Device& device, std::span<const uint32_t> shader, uint32_t push_bytes)
    : device_(device), push_bytes_(push_bytes), layout_(make_layout(device, push_bytes)) {
  const ShaderModule module(device, shader);
  const VkComputePipelineCreateInfo info{.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
                                         .stage = module.stage(VK_SHADER_STAGE_COMPUTE_BIT),
                                         .layout = layout_};
  check(vkCreateComputePipelines(device.handle(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_),
        "a compute pipeline");
}

Compute::~Compute() {
  vkDestroyPipeline(device_.handle(), pipeline_, nullptr);
  vkDestroyPipelineLayout(device_.handle(), layout_, nullptr);
}

void Compute::record(VkCommandBuffer commands, const void* push, uint32_t groups) const {
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
  vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_ALL, 0, push_bytes_, push);
  vkCmdDispatch(commands, groups, 1, 1);
  wait_for_writes(commands);
}

}  // namespace sample
