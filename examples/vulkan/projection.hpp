// From the world to Vulkan's clip space: y down, depth near / distance, without a far plane.
#pragma once

#include <array>
#include <cmath>
#include <umbel/camera.hpp>

namespace sample {

inline umbel::Vec3 minus(const umbel::Vec3& a, const umbel::Vec3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline float dot(const umbel::Vec3& a, const umbel::Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline umbel::Vec3 cross(const umbel::Vec3& a, const umbel::Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline umbel::Vec3 unit(const umbel::Vec3& a) {
  const float length = std::sqrt(dot(a, a));
  return {a.x / length, a.y / length, a.z / length};
}

/// By columns, as GLSL has matrices.
inline std::array<float, 16> clip_from_world(const umbel::Camera& camera, float aspect,
                                             float near_plane) {
  const umbel::Vec3 forward = unit(minus(camera.target, camera.position));
  const umbel::Vec3 right = unit(cross(forward, camera.up));
  const umbel::Vec3 up = cross(right, forward);
  const float tangent = std::tan(camera.fov_y / 2);
  const float x = 1 / (tangent * aspect), y = -1 / tangent;
  const umbel::Vec3& eye = camera.position;
  return {x * right.x,          y * up.x,          0,          forward.x,  //
          x * right.y,          y * up.y,          0,          forward.y,  //
          x * right.z,          y * up.z,          0,          forward.z,  //
          -x * dot(right, eye), -y * dot(up, eye), near_plane, -dot(forward, eye)};
}

}  // namespace sample
