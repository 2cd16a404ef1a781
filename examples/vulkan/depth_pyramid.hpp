// The farthest depth of ever larger squares of the picture: what the occlusion tests read.
#pragma once

#include "layouts.hpp"
#include "memory.hpp"
#include "pipelines.hpp"

namespace sample {

class DepthPyramid {
 public:
  /// Of pictures of one size. Hides nothing until it is recorded.
  DepthPyramid(const Device& device, uint32_t width, uint32_t height);
  VkDeviceAddress address() const { return texels_.address(); }

  /// Takes over a depth image, in the layout for transfers from it, after all writes.
  void record(VkCommandBuffer commands, const Image& depth, const Pipelines& pipelines,
              VkDeviceAddress frame) const;

 private:
  uint32_t width_, height_;
  Buffer texels_;
};

}  // namespace sample
