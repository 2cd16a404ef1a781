// What the ray generation shader needs to know of a camera, and of the light.
#pragma once

#include <cmath>

#include "frame.hpp"
#include "layouts.hpp"
#include "projection.hpp"

namespace sample {

inline GpuRays rays_through(const FrameInput& input, uint32_t width, uint32_t height) {
  constexpr umbel::Vec3 kSun{0.45f, 0.75f, 0.48f};
  const umbel::Camera& camera = input.camera;
  const umbel::Vec3 forward = unit(minus(camera.target, camera.position));
  const umbel::Vec3 right = unit(cross(forward, camera.up)), up = cross(right, forward);
  const float y = std::tan(camera.fov_y / 2);
  const float x = y * static_cast<float>(width) / static_cast<float>(height);
  return {.right = {x * right.x, x * right.y, x * right.z},
          .up = {y * up.x, y * up.y, y * up.z},
          .forward = forward,
          .sun = unit(kSun),
          .background = input.background};
}

}  // namespace sample
