#include "depth_pyramid.hpp"

#include <vector>

namespace sample {

namespace {

uint64_t texels_of(uint64_t width, uint64_t height) {
  uint64_t texels = width * height;
  while (width > 1 || height > 1) {
    width = (width + 1) / 2;
    height = (height + 1) / 2;
    texels += width * height;
  }
  return texels;
}

}  // namespace

DepthPyramid::DepthPyramid(const Device& device, uint32_t width, uint32_t height)
    : width_(width),
      height_(height),
      texels_(device, 4 * texels_of(width, height), Place::kDevice) {
  device.run([&](VkCommandBuffer commands) {
    vkCmdFillBuffer(commands, texels_.handle(), 0, VK_WHOLE_SIZE, 0);
  });
}

void DepthPyramid::record(VkCommandBuffer commands, const Image& depth, const Pipelines& pipelines,
                          VkDeviceAddress frame) const {
  const VkBufferImageCopy copy{.imageSubresource = {VK_IMAGE_ASPECT_DEPTH_BIT, 0, 0, 1},
                               .imageExtent = {width_, height_, 1}};
  vkCmdCopyImageToBuffer(commands, depth.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         texels_.handle(), 1, &copy);
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines.pyramid());
  uint32_t width = width_, height = height_;
  for (uint32_t level = 1; width > 1 || height > 1; ++level) {
    width = (width + 1) / 2;
    height = (height + 1) / 2;
    wait_for_writes(commands);
    const GpuPush push{frame, level, 0};
    vkCmdPushConstants(commands, pipelines.layout(), VK_SHADER_STAGE_ALL, 0, kPushBytes, &push);
    vkCmdDispatch(commands, (width + 7) / 8, (height + 7) / 8, 1);
  }
  wait_for_writes(commands);
}

}  // namespace sample
