// What decides a cut: an error, a camera, or a level.
#include <cmath>

#include "base/math.hpp"
#include "lod/refine.hpp"
#include "umbel/lod.hpp"

namespace umbel::lod {
namespace {

[[noreturn]] void reject(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, what);
}

}  // namespace

View view_error(float error) {
  if (!(error >= 0))
    reject("view_error: error must be at least 0, but is " + std::to_string(error));
  View view;
  view.kind = View::Kind::kError;
  view.error = error;
  return view;
}

View view_camera(const Vec3& eye, float fov_y, uint32_t height, float pixel_error) {
  constexpr float kPi = 3.14159265f;
  if (!is_finite(eye)) reject("view_camera: eye must be finite");
  if (!(fov_y > 0 && fov_y < kPi))
    reject("view_camera: fov_y must be between 0 and pi radians, but is " + std::to_string(fov_y));
  if (height == 0) reject("view_camera: height must be at least 1 pixel, but is 0");
  if (!(pixel_error >= 0 && std::isfinite(pixel_error)))
    reject("view_camera: pixel_error must be at least 0 and finite, but is " +
           std::to_string(pixel_error));
  View view;
  view.kind = View::Kind::kCamera;
  view.eye = eye;
  view.threshold = static_cast<float>(2.0 * pixel_error * std::tan(0.5 * fov_y) / height);
  return view;
}

View view_level(uint32_t level) {
  View view;
  view.kind = View::Kind::kLevel;
  view.level = level;
  return view;
}

}  // namespace umbel::lod
