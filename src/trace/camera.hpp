// A camera prepared to make rays.
#pragma once

#include "trace/vector.hpp"
#include "umbel/trace.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::trace {

/// Throws kInvalidArgument for a size that no picture can have.
void check_picture_size(uint32_t width, uint32_t height);

class RayCamera {
 public:
  /// Throws kInvalidArgument for values out of range, or a target at the position.
  RayCamera(const Camera& camera, uint32_t width, uint32_t height);

  /// The ray through (x, y) of the picture, in pixels, from the lens' point that `lens` of the unit
  /// square maps to.
  Ray ray(float x, float y, const Vec2& lens) const;

  /// Where a point is seen through a pinhole, in pixels. False if it is not before the camera.
  bool pixel_of(const Vec3& point, double (&at)[2]) const;

 private:
  Vec3 position_;
  Basis basis_;  ///< right, up, backwards
  float scale_;  ///< of a pixel, at distance 1
  float center_x_, center_y_;
  float lens_radius_, focus_distance_;
};

}  // namespace umbel::trace
