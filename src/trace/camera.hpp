// A camera made ready to shoot rays.
#pragma once

#include "trace/vector.hpp"
#include "umbel/trace.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::trace {

class RayCamera {
 public:
  /// Throws kInvalidArgument for a camera that looks nowhere.
  RayCamera(const Camera& camera, uint32_t width, uint32_t height);

  /// Through the place (x, y) of the picture in pixels, from the place `lens` of the unit square.
  Ray ray(float x, float y, const Vec2& lens) const;

 private:
  Vec3 position_;
  Frame frame_;  ///< right, up, backwards
  float scale_;  ///< of a pixel, at distance 1
  float center_x_, center_y_;
  float lens_radius_, focus_distance_;
};

}  // namespace umbel::trace
