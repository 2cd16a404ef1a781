#include "pipelines.hpp"

#include <array>

#include "layouts.hpp"
#include "shader_module.hpp"

namespace sample {

namespace {

// Compiled by CMake: an array of words each.
#include "cluster.frag.h"
#include "cluster.mesh.h"
#include "cluster.vert.h"
#include "depth_pyramid.comp.h"
#include "retest.comp.h"
#include "select.comp.h"

}  // namespace

Pipelines::Pipelines(const Device& device, bool mesh_shaders) : device_(device) {
  layout_ = make_layout(device);
  select_ = make_compute(select_comp);
  pyramid_ = make_compute(depth_pyramid_comp);
  retest_ = make_compute(retest_comp);
  make_draw(mesh_shaders);
}

Pipelines::~Pipelines() {
  for (VkPipeline pipeline : {draw_, retest_, pyramid_, select_}) {
    vkDestroyPipeline(device_.handle(), pipeline, nullptr);
  }
  vkDestroyPipelineLayout(device_.handle(), layout_, nullptr);
}

VkPipeline Pipelines::make_compute(std::span<const uint32_t> shader) const {
  const ShaderModule module(device_, shader);
  const VkComputePipelineCreateInfo info{.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
                                         .stage = module.stage(VK_SHADER_STAGE_COMPUTE_BIT),
                                         .layout = layout_};
  VkPipeline pipeline = VK_NULL_HANDLE;
  check(vkCreateComputePipelines(device_.handle(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline),
        "a compute pipeline");
  return pipeline;
}

// Long, but only a list of what Vulkan wants to know: triangles from both sides, a depth test.
void Pipelines::make_draw(bool mesh_shaders) {
  const ShaderModule first(device_, mesh_shaders ? std::span<const uint32_t>(cluster_mesh)
                                                 : std::span<const uint32_t>(cluster_vert));
  const ShaderModule fragment(device_, cluster_frag);
  const std::array stages = {
      first.stage(mesh_shaders ? VK_SHADER_STAGE_MESH_BIT_EXT : VK_SHADER_STAGE_VERTEX_BIT),
      fragment.stage(VK_SHADER_STAGE_FRAGMENT_BIT)};
  const VkPipelineVertexInputStateCreateInfo vertices{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO};
  const VkPipelineInputAssemblyStateCreateInfo assembly{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO,
      .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
  const VkPipelineViewportStateCreateInfo viewport{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO,
      .viewportCount = 1,
      .scissorCount = 1};
  const VkPipelineRasterizationStateCreateInfo raster{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO,
      .polygonMode = VK_POLYGON_MODE_FILL,
      .cullMode = VK_CULL_MODE_NONE,
      .lineWidth = 1};
  const VkPipelineMultisampleStateCreateInfo samples{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO,
      .rasterizationSamples = VK_SAMPLE_COUNT_1_BIT};
  // Depth is near / distance: exact far away, too.
  const VkPipelineDepthStencilStateCreateInfo depth{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO,
      .depthTestEnable = VK_TRUE,
      .depthWriteEnable = VK_TRUE,
      .depthCompareOp = VK_COMPARE_OP_GREATER};
  const VkPipelineColorBlendAttachmentState attachment{.colorWriteMask = 0xf};
  const VkPipelineColorBlendStateCreateInfo blend{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO,
      .attachmentCount = 1,
      .pAttachments = &attachment};
  const std::array dynamic = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
  const VkPipelineDynamicStateCreateInfo states{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO,
      .dynamicStateCount = dynamic.size(),
      .pDynamicStates = dynamic.data()};
  const VkPipelineRenderingCreateInfo formats{
      .sType = VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO,
      .colorAttachmentCount = 1,
      .pColorAttachmentFormats = &kColorFormat,
      .depthAttachmentFormat = kDepthFormat};
  const VkGraphicsPipelineCreateInfo info{.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO,
                                          .pNext = &formats,
                                          .stageCount = stages.size(),
                                          .pStages = stages.data(),
                                          .pVertexInputState = mesh_shaders ? nullptr : &vertices,
                                          .pInputAssemblyState = mesh_shaders ? nullptr : &assembly,
                                          .pViewportState = &viewport,
                                          .pRasterizationState = &raster,
                                          .pMultisampleState = &samples,
                                          .pDepthStencilState = &depth,
                                          .pColorBlendState = &blend,
                                          .pDynamicState = &states,
                                          .layout = layout_};
  check(vkCreateGraphicsPipelines(device_.handle(), VK_NULL_HANDLE, 1, &info, nullptr, &draw_),
        "the drawing's pipeline");
}

}  // namespace sample
