// A frame's input and what is said of it, however its picture is made.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <umbel/umbel.hpp>

#include "memory.hpp"

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
  uint32_t built = 0, kept = 0;  ///< bottom-level structures, where the picture is traced
  uint64_t structure_bytes = 0;
};

/// What makes a picture a frame: by drawing (renderer.hpp) or by tracing (traced_renderer.hpp).
class FrameMaker {
 public:
  virtual ~FrameMaker() = default;
  /// Makes a picture, and then lets the residency load what it lacked. `now` is in seconds. Throws
  /// where more is visible than there is room for.
  virtual FrameReport draw(const FrameInput& input, double now) = 0;
  /// The last picture: red, green, blue, alpha, row by row from the top.
  virtual std::span<const uint8_t> pixels() const = 0;
  /// The same on the device, in the layout for transfers from it.
  virtual const Image& color() const = 0;
  /// Pages and requests stay.
  virtual void resize(uint32_t width, uint32_t height) = 0;
  virtual std::string method() const = 0;
};

}  // namespace sample
