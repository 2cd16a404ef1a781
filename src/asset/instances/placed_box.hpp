// The box of a mesh where an instance puts it: a parallelepiped.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "asset/instances/matrix3.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

class PlacedBox {
 public:
  PlacedBox(const Aabb& box, const Transform& transform) {
    // A mesh without triangles has an empty box: a point, where its origin is.
    const bool is_empty = box.min.x > box.max.x;
    const std::array<double, 3> low{is_empty ? 0 : double{box.min.x},
                                    is_empty ? 0 : double{box.min.y},
                                    is_empty ? 0 : double{box.min.z}};
    const std::array<double, 3> high{is_empty ? 0 : double{box.max.x},
                                     is_empty ? 0 : double{box.max.y},
                                     is_empty ? 0 : double{box.max.z}};
    const auto row = [&](int i, int j) { return double{transform.rows[4 * i + j]}; };
    std::array<double, 3> center{row(0, 3), row(1, 3), row(2, 3)};
    for (int j = 0; j < 3; ++j) {
      const double middle = 0.5 * (low[j] + high[j]), half = 0.5 * (high[j] - low[j]);
      for (int i = 0; i < 3; ++i) center[i] += row(i, j) * middle;
      axes_[j] = {row(0, j) * half, row(1, j) * half, row(2, j) * half};
    }
    center_ = {center[0], center[1], center[2]};
    for (int k = 0; k < 3; ++k) area_ += length(cross(axes_[k], axes_[(k + 1) % 3]));
    invert();
  }

  const Vec3d& center() const { return center_; }
  /// A quarter of its surface.
  double area() const { return area_; }
  /// Half of the longest diagonal.
  double radius() const {
    double most = 0;
    for (int k = 0; k < 4; ++k) {
      const Vec3d d = axes_[0] + (k & 1 ? 1.0 : -1.0) * axes_[1] + (k & 2 ? 1.0 : -1.0) * axes_[2];
      most = std::max(most, dot(d, d));
    }
    return std::sqrt(most);
  }
  /// Whether it has no extent along an axis of the mesh, beside those along others.
  bool is_flat(int axis) const {
    double most = 0;
    for (const Vec3d& one : axes_) most = std::max(most, length(one));
    return length(axes_[axis]) <= kThickness * most;
  }
  /// Of points spread evenly within it.
  Matrix3 covariance() const {
    Matrix3 sum{};
    for (const Vec3d& axis : axes_) add_square(sum, axis, 1.0 / 3);
    return sum;
  }
  /// From -1 to 1 along each axis.
  Vec3d point(double u, double v, double w) const {
    return center_ + u * axes_[0] + v * axes_[1] + w * axes_[2];
  }
  /// About how far a point is from the box: never less, and nothing within it.
  double distance(const Vec3d& p) const {
    const Vec3d from = p - center_;
    const auto clamped = [&](int k) { return std::clamp(dot(inverse_[k], from), -1.0, 1.0); };
    const Vec3d off = p - point(clamped(0), clamped(1), clamped(2));
    return length(off);
  }

 private:
  static constexpr double kThickness = 1e-6;

  /// A flat box gets a little thickness, so that points within it are told from others.
  void invert() {
    std::array<Vec3d, 3> axes = axes_;
    const auto shorter = [](const Vec3d& a, const Vec3d& b) { return dot(a, a) < dot(b, b); };
    auto* const shortest = std::min_element(axes.data(), axes.data() + 3, shorter);
    const auto at = static_cast<size_t>(shortest - axes.data());
    const Vec3d normal = cross(axes[(at + 1) % 3], axes[(at + 2) % 3]);
    const double size = length(normal);
    if (size > 0 && std::fabs(dot(axes[at], normal)) <= kThickness * size * std::sqrt(size))
      *shortest = (kThickness / std::sqrt(size)) * normal;
    const Vec3d first = cross(axes[1], axes[2]);
    const double volume = dot(axes[0], first);
    if (volume == 0) return;  // a point or a line, which its center stands for
    inverse_ = {(1 / volume) * first, (1 / volume) * cross(axes[2], axes[0]),
                (1 / volume) * cross(axes[0], axes[1])};
  }

  Vec3d center_;
  std::array<Vec3d, 3> axes_, inverse_{};
  double area_ = 0;
};

/// The largest factor by which a transform changes lengths, or a little more.
inline double largest_scale(const Transform& transform) {
  constexpr double kMargin = 1 + 1e-6, kSmall = 1e-7;
  const auto& t = transform.rows;
  Matrix3 gram{};
  for (int i = 0; i < 3; ++i)
    add_square(gram, {double{t[4 * i]}, double{t[4 * i + 1]}, double{t[4 * i + 2]}}, 1);
  const double most = std::max({gram[0][0], gram[1][1], gram[2][2]});
  const double off = std::fabs(gram[0][1]) + std::fabs(gram[0][2]) + std::fabs(gram[1][2]);
  // Most are rotations and scales, which need no search for the axes.
  if (off <= kSmall * most) return std::sqrt(most + off) * kMargin;
  const auto values = eigen(gram).values;
  return std::sqrt(std::max({values[0], values[1], values[2], 0.0})) * kMargin;
}

}  // namespace umbel::asset
