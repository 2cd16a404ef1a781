#include "bvh/two_level/instance_transform.hpp"

#include <cmath>

#include "base/math.hpp"

namespace umbel::bvh {
namespace {

Vec3 rotated(const std::array<float, 12>& m, const Vec3& v) {
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
          m[8] * v.x + m[9] * v.y + m[10] * v.z};
}

std::array<float, 12> inverse_of(const std::array<float, 12>& m) {
  const double a = m[0], b = m[1], c = m[2], d = m[4], e = m[5], f = m[6], g = m[8], h = m[9],
               i = m[10];
  const double determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
  const double s = 1 / determinant;
  const double r[9] = {(e * i - f * h) * s, (c * h - b * i) * s, (b * f - c * e) * s,
                       (f * g - d * i) * s, (a * i - c * g) * s, (c * d - a * f) * s,
                       (d * h - e * g) * s, (b * g - a * h) * s, (a * e - b * d) * s};
  std::array<float, 12> out;
  for (int row = 0; row < 3; ++row) {
    for (int k = 0; k < 3; ++k) out[4 * row + k] = static_cast<float>(r[3 * row + k]);
    out[4 * row + 3] =
        static_cast<float>(-(r[3 * row] * m[3] + r[3 * row + 1] * m[7] + r[3 * row + 2] * m[11]));
  }
  return out;
}

}  // namespace

InstanceTransform::InstanceTransform(const Transform& to_world)
    : to_world_(to_world.rows), to_object_(inverse_of(to_world.rows)), scale_(0) {
  double squares = 0;
  for (int i = 0; i < 12; ++i) {
    if (i % 4 != 3) squares += double(to_world_[i]) * to_world_[i];
    if (!std::isfinite(to_object_[i]))
      throw Error(ErrorCode::kInvalidArgument, "a transform of the scene cannot be inverted");
  }
  scale_ = static_cast<float>(std::sqrt(squares));
}

Vec3 InstanceTransform::point_to_world(const Vec3& p) const {
  return rotated(to_world_, p) + Vec3{to_world_[3], to_world_[7], to_world_[11]};
}
Vec3 InstanceTransform::point_to_object(const Vec3& p) const {
  return rotated(to_object_, p) + Vec3{to_object_[3], to_object_[7], to_object_[11]};
}
Vec3 InstanceTransform::vector_to_object(const Vec3& v) const { return rotated(to_object_, v); }

Vec3 InstanceTransform::normal_to_world(const Vec3& n) const {
  const auto& m = to_object_;
  return {m[0] * n.x + m[4] * n.y + m[8] * n.z, m[1] * n.x + m[5] * n.y + m[9] * n.z,
          m[2] * n.x + m[6] * n.y + m[10] * n.z};
}

Aabb InstanceTransform::box_to_world(const Aabb& box) const {
  Aabb out;
  for (int corner = 0; corner < 8; ++corner)
    extend(out,
           point_to_world({corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                           corner & 4 ? box.max.z : box.min.z}));
  // Rounding errors of both maps are relative to their terms, which may be far larger than the
  // sums.
  const Vec3 away = max(box.max, box.min * -1.0f);
  const auto& m = to_world_;
  const Vec3 local{away.x + std::fabs(to_object_[3]), away.y + std::fabs(to_object_[7]),
                   away.z + std::fabs(to_object_[11])};
  const auto size = [&](int row) {
    return std::fabs(m[row]) * local.x + std::fabs(m[row + 1]) * local.y +
           std::fabs(m[row + 2]) * local.z + std::fabs(m[row + 3]);
  };
  const Vec3 error_bound = Vec3{size(0), size(4), size(8)} * 2e-6f;
  return {out.min - error_bound, out.max + error_bound};
}

}  // namespace umbel::bvh
