// What decides a cut: an error, a camera, or a level; and the frustum of a camera.
#include <cmath>

#include "base/math.hpp"
#include "base/printed.hpp"
#include "base/refuse.hpp"
#include "lod/select/refine.hpp"
#include "umbel/lod/select.hpp"

namespace umbel::lod {
namespace {

using Row = std::array<double, 3>;

Row row(const Vec3& v) { return {v.x, v.y, v.z}; }

Row cross(const Row& a, const Row& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Row& a, const Row& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Row sum(const Row& a, double scale, const Row& b) {
  return {a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]};
}

Row unit(const Row& a, const char* what) {
  const double length = std::sqrt(dot(a, a));
  if (!(length > 0 && std::isfinite(length)))
    refuse(std::string("frustum_planes: ") + what + " gives no direction");
  return {a[0] / length, a[1] / length, a[2] / length};
}

// Through the point `at` moved `offset` along the normal.
Plane plane_through(const Row& normal, const Row& at, double offset) {
  return {
      {static_cast<float>(normal[0]), static_cast<float>(normal[1]), static_cast<float>(normal[2])},
      static_cast<float>(-dot(normal, at) - offset)};
}

}  // namespace

View view_error(float error) {
  if (!(error >= 0)) refuse("view_error: error must be at least 0, but is " + printed(error));
  View view;
  view.kind = View::Kind::kError;
  view.error = error;
  return view;
}

View view_camera(const Vec3& eye, float fov_y, uint32_t height, float pixel_error) {
  constexpr float kPi = 3.14159265f;
  if (!is_finite(eye)) refuse("view_camera: eye must be finite");
  if (!(fov_y > 0 && fov_y < kPi))
    refuse("view_camera: fov_y must be between 0 and pi radians, but is " + std::to_string(fov_y));
  if (height == 0) refuse("view_camera: height must be at least 1 pixel, but is 0");
  if (!(pixel_error >= 0 && std::isfinite(pixel_error)))
    refuse("view_camera: pixel_error must be at least 0 and finite, but is " +
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

std::vector<Plane> frustum_planes(const Camera& camera, float aspect, float near_plane,
                                  float far_plane) {
  constexpr float kPi = 3.14159265f;
  if (!is_finite(camera.position) || !is_finite(camera.target) || !is_finite(camera.up))
    refuse("frustum_planes: position, target and up must be finite");
  if (!(camera.fov_y > 0 && camera.fov_y < kPi))
    refuse("frustum_planes: fov_y must be between 0 and pi radians, but is " +
           std::to_string(camera.fov_y));
  if (!(aspect > 0 && std::isfinite(aspect)))
    refuse("frustum_planes: aspect must be over 0 and finite, but is " + std::to_string(aspect));
  if (!(near_plane >= 0 && far_plane > near_plane))
    refuse("frustum_planes: must be 0 <= near_plane < far_plane, but they are " +
           std::to_string(near_plane) + " and " + std::to_string(far_plane));
  const Row eye = row(camera.position);
  const Row ahead = unit(sum(row(camera.target), -1, eye), "the target, which is the position,");
  const Row right = unit(cross(ahead, row(camera.up)), "up, which is along the line of sight,");
  const Row up = cross(right, ahead);
  const double y = std::tan(0.5 * camera.fov_y), x = y * aspect;
  const auto side = [&](const Row& inwards, double tangent) {
    return plane_through(unit(sum(inwards, tangent, ahead), "the field of view"), eye, 0);
  };
  std::vector<Plane> planes = {side(right, x), side(sum({}, -1, right), x), side(up, y),
                               side(sum({}, -1, up), y), plane_through(ahead, eye, near_plane)};
  if (std::isfinite(far_plane))
    planes.push_back(plane_through(sum({}, -1, ahead), eye, -double{far_plane}));
  return planes;
}

double angular_error(double error, double distance) {
  constexpr double kHalfPi = 1.5707963267948966;
  if (!(error >= 0)) refuse("angular_error: error must be at least 0");
  if (error == 0) return 0;
  return error < distance ? std::asin(error / distance) : kHalfPi;
}

double pixel_error(double error, double distance, double fov_y, uint32_t height) {
  if (!(error >= 0)) refuse("pixel_error: error must be at least 0");
  if (error == 0) return 0;
  if (!(distance > 0)) return std::numeric_limits<double>::infinity();
  return error / distance * height / (2 * std::tan(0.5 * fov_y));
}

}  // namespace umbel::lod
