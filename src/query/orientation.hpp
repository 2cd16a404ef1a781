// Exact signs of 2D and 3D orientation determinants of single-precision points: an error bound
// first, and where it cannot tell, an exact sum. The bound and the exact sums are those of
// Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates",
// 1997. Products of two floats are exact in double, which shortens the exact part.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "base/host_device.hpp"
#include "umbel/types.hpp"

namespace umbel::orientation {

/// A sum of doubles kept without any rounding: components that do not overlap, smallest first.
template <size_t kMost>
class ExactSum {
 public:
  UMBEL_HOST_DEVICE void add(double value) {
    size_t kept = 0;
    for (size_t i = 0; i < count_; ++i) {
      const double sum = value + terms_[i];
      const double part = sum - value;
      const double error = (value - (sum - part)) + (terms_[i] - part);
      if (error != 0) terms_[kept++] = error;
      value = sum;
    }
    if (value != 0) terms_[kept++] = value;
    count_ = kept;
  }
  /// Adds a * b exactly (Dekker's product).
  UMBEL_HOST_DEVICE void add_product(double a, double b) {
    const double product = a * b;
    const auto split = [](double x) {
      const double shifted = 134217729.0 * x;
      return shifted - (shifted - x);
    };
    const double a_high = split(a), b_high = split(b);
    const double a_low = a - a_high, b_low = b - b_high;
    add(((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low);
    add(product);
  }
  UMBEL_HOST_DEVICE int sign() const {
    if (count_ == 0) return 0;
    return terms_[count_ - 1] > 0 ? 1 : -1;
  }

 private:
  std::array<double, kMost> terms_{};
  size_t count_ = 0;
};

UMBEL_HOST_DEVICE inline int sign(double value) { return (value > 0) - (value < 0); }

/// A point of a plane.
struct Point2 {
  float x, y;
};

/// 1 where a, b, c turn counter-clockwise, -1 where they turn clockwise, 0 on a line.
UMBEL_HOST_DEVICE inline int orient2d(const Point2& a, const Point2& b, const Point2& c) {
  const double left = (double(a.x) - c.x) * (double(b.y) - c.y);
  const double right = (double(a.y) - c.y) * (double(b.x) - c.x);
  const double determinant = left - right;
  constexpr double kBound = 3.3306690738754716e-16;
  if (std::abs(determinant) > kBound * (std::abs(left) + std::abs(right))) return sign(determinant);
  ExactSum<6> sum;
  const auto add = [&](float p, float q) { sum.add(double(p) * q); };
  add(a.x, b.y), add(-a.y, b.x);
  add(b.x, c.y), add(-b.y, c.x);
  add(c.x, a.y), add(-c.y, a.x);
  return sum.sign();
}

namespace detail {

UMBEL_HOST_DEVICE inline int orient3d_exact(const Vec3& a, const Vec3& b, const Vec3& c,
                                            const Vec3& d) {
  ExactSum<48> sum;
  // The determinant of the rows (p, 1), expanded by the third coordinate: each pair of minors of
  // the others is one product of two floats.
  const auto add = [&](const Vec3& p, const Vec3& q, float z) {
    sum.add_product(double(p.x) * q.y, z);
    sum.add_product(double(p.y) * q.x, -double(z));
  };
  const auto triangle = [&](const Vec3& p, const Vec3& q, const Vec3& r, float z) {
    add(p, q, z), add(q, r, z), add(r, p, z);
  };
  triangle(b, c, d, -a.z);
  triangle(a, c, d, b.z);
  triangle(a, b, d, -c.z);
  triangle(a, b, c, d.z);
  // Of the determinant |a 1; b 1; c 1; d 1| this is the negative, and so is what is asked for.
  return -sum.sign();
}

}  // namespace detail

/// 1 where d lies below the plane through a, b, c, that is, on the side from which they turn
/// clockwise; -1 above it; 0 in it.
UMBEL_HOST_DEVICE inline int orient3d(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const double adx = double(a.x) - d.x, ady = double(a.y) - d.y, adz = double(a.z) - d.z;
  const double bdx = double(b.x) - d.x, bdy = double(b.y) - d.y, bdz = double(b.z) - d.z;
  const double cdx = double(c.x) - d.x, cdy = double(c.y) - d.y, cdz = double(c.z) - d.z;
  const double bc1 = bdx * cdy, bc2 = cdx * bdy;
  const double ca1 = cdx * ady, ca2 = adx * cdy;
  const double ab1 = adx * bdy, ab2 = bdx * ady;
  const double determinant = adz * (bc1 - bc2) + bdz * (ca1 - ca2) + cdz * (ab1 - ab2);
  const double permanent = (std::abs(bc1) + std::abs(bc2)) * std::abs(adz) +
                           (std::abs(ca1) + std::abs(ca2)) * std::abs(bdz) +
                           (std::abs(ab1) + std::abs(ab2)) * std::abs(cdz);
  constexpr double kBound = 7.7715611723761027e-16;
  if (std::abs(determinant) > kBound * permanent) return sign(determinant);
  return detail::orient3d_exact(a, b, c, d);
}

}  // namespace umbel::orientation
