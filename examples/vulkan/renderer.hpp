// A frame: pages, selection, drawing, and what the selection asks the residency for.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <umbel/umbel.hpp>
#include <vector>

#include "depth_pyramid.hpp"
#include "frame.hpp"
#include "page_pool.hpp"
#include "pipelines.hpp"
#include "tables.hpp"

namespace sample {

/// What is drawn on, all of one size.
struct Picture {
  Picture(const Device& device, uint32_t width, uint32_t height);
  Image color, depth;
  DepthPyramid pyramid;
  Buffer readback;
};

class Renderer : public FrameMaker {
 public:
  /// The asset must outlive it.
  Renderer(const Device& device, const umbel::Asset& asset, std::vector<umbel::Transform> instances,
           const RendererConfig& config);

  /// Throws if more is visible than RendererConfig::capacity holds.
  FrameReport draw(const FrameInput& input, double now) override;
  std::span<const uint8_t> pixels() const override { return picture_->readback.mapped<uint8_t>(); }
  const Image& color() const override { return picture_->color; }
  void resize(uint32_t width, uint32_t height) override;
  std::string method() const override {
    return mesh_shaders_ ? "drawn by mesh shaders" : "drawn by a vertex shader";
  }
  bool mesh_shaders() const { return mesh_shaders_; }

 private:
  void write_instances(const FrameInput& input);
  void write_frame(const FrameInput& input) const;
  void record_selection(VkCommandBuffer commands) const;
  void record_passes(VkCommandBuffer commands, const FrameInput& input) const;
  void begin_drawing(VkCommandBuffer commands, const FrameInput& input, bool first) const;
  void record_pass(VkCommandBuffer commands, const FrameInput& input, uint32_t pass) const;
  void check_capacity() const;
  void record_readback(VkCommandBuffer commands) const;
  std::vector<umbel::StreamView> requests() const;

  const Device& device_;
  const umbel::Asset& asset_;
  RendererConfig config_;
  std::vector<umbel::Transform> transforms_;
  std::vector<umbel::StreamView> views_;  ///< one an instance, of the frame
  Tables tables_;
  PagePool pool_;
  bool mesh_shaders_;
  Pipelines pipelines_;
  Buffer instances_, frame_, queue_, visible_, hidden_, counts_, counts_read_, wanted_;
  std::unique_ptr<Picture> picture_;
  std::array<float, 16> last_clip_from_world_{};  ///< of the frame that made the pyramid
  FrameReport report_;
  std::unique_ptr<umbel::Residency> residency_;
};

}  // namespace sample
