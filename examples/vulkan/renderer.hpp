// A frame: pages, selection, drawing, and what the selection asks the residency for.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <umbel/umbel.hpp>
#include <vector>

#include "depth_pyramid.hpp"
#include "page_pool.hpp"
#include "pipelines.hpp"
#include "tables.hpp"

namespace sample {

struct RendererConfig {
  uint32_t width = 960, height = 540;
  uint64_t budget_bytes = uint64_t{64} << 20;  ///< of pages on the device, decoded
  uint32_t capacity = 1u << 18;                ///< most clusters, and nodes of a layer, of a frame
  bool mesh_shaders = true;                    ///< where the device has them
};

struct FrameInput {
  umbel::Camera camera;
  float pixel_error = 1;
  float near_plane = 0.01f;
  enum class Looks : uint32_t { kNormals = 0, kClusters = 1, kShaded = 2 } looks = Looks::kNormals;
  umbel::Vec4 background{1, 1, 1, 1};
  bool occlusion = true;  ///< leaves out what the depth hides; the picture is the same without
  bool frozen = false;    ///< draws the last frame's clusters again, from this camera
};

struct FrameReport {
  uint32_t clusters = 0;  ///< drawn
  uint32_t late = 0;      ///< of these by the second pass
  uint32_t hidden = 0;    ///< in the frustum, and left out
  uint32_t views = 0;     ///< instances that asked for groups
  umbel::StreamStep step;
  uint32_t used_slots = 0, slots = 0;
};

/// What is drawn on, all of one size.
struct Picture {
  Picture(const Device& device, uint32_t width, uint32_t height);
  Image color, depth;
  DepthPyramid pyramid;
  Buffer readback;
};

class Renderer {
 public:
  /// The asset must outlive it.
  Renderer(const Device& device, const umbel::Asset& asset, std::vector<umbel::Transform> instances,
           const RendererConfig& config);

  /// Draws, and then lets the residency load what the picture lacked. `now` is in seconds. Throws
  /// if more is visible than RendererConfig::capacity holds.
  FrameReport draw(const FrameInput& input, double now);
  /// The last frame's pixels, red, green, blue, alpha, row by row from the top.
  std::span<const uint8_t> pixels() const { return picture_->readback.mapped<uint8_t>(); }
  /// The same on the device, in the layout for transfers from it.
  const Image& color() const { return picture_->color; }
  /// Pages and requests stay.
  void resize(uint32_t width, uint32_t height);
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
