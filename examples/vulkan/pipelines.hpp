// The sample's pipelines. All take the frame's address and a number as push constants, and nothing
// else, so they share one layout without descriptors.
#pragma once

#include <cstdint>
#include <span>

#include "memory.hpp"

namespace sample {

class Pipelines {
 public:
  /// `mesh_shaders`: clusters are drawn by them, else by a vertex shader.
  Pipelines(const Device& device, bool mesh_shaders);
  ~Pipelines();
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;

  VkPipelineLayout layout() const { return layout_; }
  VkPipeline select() const { return select_; }
  VkPipeline pyramid() const { return pyramid_; }
  VkPipeline retest() const { return retest_; }
  VkPipeline draw() const { return draw_; }

 private:
  VkPipeline make_compute(std::span<const uint32_t> shader) const;
  void make_draw(bool mesh_shaders);

  const Device& device_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline select_ = VK_NULL_HANDLE, pyramid_ = VK_NULL_HANDLE, retest_ = VK_NULL_HANDLE,
             draw_ = VK_NULL_HANDLE;
};

}  // namespace sample
