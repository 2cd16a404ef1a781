// Where a picture is taken from: for rendering (trace.hpp) and for culling (lod/select.hpp).
#pragma once

#include "umbel/types.hpp"

namespace umbel {

/// A perspective camera. Rays go through the pixels of a plane perpendicular to target - position;
/// `up` points to the picture's top.
struct Camera {
  Vec3 position{0, 0, 1};
  Vec3 target{0, 0, 0};
  Vec3 up{0, 1, 0};
  float fov_y = 0.6981317f;     ///< vertical field of view in radians, in (0, pi)
  float lens_radius = 0.0f;     ///< of a thin lens, in the scene's unit; 0: a pinhole, all sharp
  float focus_distance = 0.0f;  ///< where the lens is sharp; 0: at the target
};

}  // namespace umbel
