// Where an instance stands.
#pragma once

#include <array>

#include "umbel/types.hpp"

namespace umbel::bvh {

/// An affine map and its inverse.
class InstanceTransform {
 public:
  /// Throws kInvalidArgument if it cannot be inverted.
  explicit InstanceTransform(const Transform& to_world);

  Vec3 point_to_world(const Vec3& p) const;
  Vec3 point_to_object(const Vec3& p) const;
  Vec3 vector_to_object(const Vec3& v) const;
  /// Not of unit length.
  Vec3 normal_to_world(const Vec3& n) const;
  Aabb box_to_world(const Aabb& box) const;
  float scale() const { return scale_; }  ///< most that a length grows, or a little more

 private:
  std::array<float, 12> to_world_, to_object_;
  float scale_;
};

}  // namespace umbel::bvh
