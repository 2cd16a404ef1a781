// Perspective cameras with a pinhole or a thin lens (Cook, Porter & Carpenter 1984).
#include "trace/camera.hpp"

#include <string>

#include "base/refuse.hpp"

namespace umbel::trace {

void check_picture_size(uint32_t width, uint32_t height) {
  constexpr uint32_t kLargest = 32768;
  constexpr uint64_t kMostPixels = 1u << 28;
  const std::string picture =
      "a picture of " + std::to_string(width) + " x " + std::to_string(height) + " pixels: ";
  require(width >= 1 && width <= kLargest && height >= 1 && height <= kLargest,
          picture + "each must be from 1 to 32768");
  require(uint64_t{width} * height <= kMostPixels,
          picture + "at most 268435456 (16384 x 16384) fit");
}

RayCamera::RayCamera(const Camera& camera, uint32_t width, uint32_t height)
    : position_(camera.position),
      scale_(2.0f * std::tan(camera.fov_y / 2.0f) / static_cast<float>(height)),
      center_x_(static_cast<float>(width) / 2.0f),
      center_y_(static_cast<float>(height) / 2.0f),
      lens_radius_(camera.lens_radius),
      focus_distance_(camera.focus_distance) {
  require(is_finite(camera.position) && is_finite(camera.target) && is_finite(camera.up),
          "the camera's position, target and up must be finite");
  require(camera.fov_y > 0.0f && camera.fov_y < kPi,
          "the camera's field of view must be between 0 and 180 degrees");
  require(camera.lens_radius >= 0.0f && std::isfinite(camera.lens_radius),
          "the camera's lens radius must be 0 or more");
  require(camera.focus_distance >= 0.0f && std::isfinite(camera.focus_distance),
          "the camera's focus distance must be 0 or more");
  const Vec3 none{0, 0, 0};
  const Vec3 forward = normalized(camera.target - camera.position, none);
  require(!is_black(forward), "the camera's target must be apart from its position");
  Vec3 right = normalized(cross(forward, normalized(camera.up, none)), none);
  // Looking along `up`, any picture is upright.
  if (is_black(right)) right = basis_around(forward).x;
  basis_ = {right, cross(right, forward), -forward};
  // In doubles, which hold the squares of all floats.
  if (focus_distance_ == 0.0f)
    focus_distance_ =
        static_cast<float>(length(to_double(camera.target) - to_double(camera.position)));
}

Ray RayCamera::ray(float x, float y, const Vec2& lens) const {
  const Vec3 through{(x - center_x_) * scale_, (center_y_ - y) * scale_, -1.0f};
  Ray ray;
  ray.origin = position_;
  if (lens_radius_ == 0.0f) {
    ray.direction = normalized(basis_.to_world(through), -basis_.z);
    return ray;
  }
  const Vec2 disc = on_disc(lens);
  const Vec3 from{disc.x * lens_radius_, disc.y * lens_radius_, 0.0f};
  ray.origin = position_ + basis_.to_world(from);
  ray.direction = normalized(basis_.to_world(through * focus_distance_ - from), -basis_.z);
  return ray;
}

bool RayCamera::pixel_of(const Vec3& point, double (&at)[2]) const {
  const double away[3] = {double{point.x} - position_.x, double{point.y} - position_.y,
                          double{point.z} - position_.z};
  const auto along = [&](const Vec3& axis) {
    return away[0] * axis.x + away[1] * axis.y + away[2] * axis.z;
  };
  const double depth = -along(basis_.z),
               size = std::abs(along(basis_.x)) + std::abs(along(basis_.y));
  // Beyond that nothing is known to fit the picture's numbers, and nothing is lost.
  if (!(depth > 1e-6 * size)) return false;
  at[0] = center_x_ + along(basis_.x) / (depth * scale_);
  at[1] = center_y_ - along(basis_.y) / (depth * scale_);
  return true;
}

}  // namespace umbel::trace
