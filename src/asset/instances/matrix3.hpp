// Symmetric 3 x 3 matrices in doubles, with no operation but those that are rounded alike
// everywhere, so that the same scene gives the same bytes.
#pragma once

#include <array>
#include <cmath>
#include <utility>

#include "base/math.hpp"
#include "umbel/types.hpp"

namespace umbel::asset {

using Matrix3 = std::array<std::array<double, 3>, 3>;

inline Vec3d operator*(const Matrix3& m, const Vec3d& v) {
  return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z,
          m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
          m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
}

inline Matrix3 product(const Matrix3& a, const Matrix3& b) {
  Matrix3 result{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) result[i][j] += a[i][k] * b[k][j];
  return result;
}

inline void add_square(Matrix3& sum, const Vec3d& v, double weight) {
  const std::array<double, 3> x{v.x, v.y, v.z};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) sum[i][j] += weight * x[i] * x[j];
}

inline double trace(const Matrix3& m) { return m[0][0] + m[1][1] + m[2][2]; }

/// Eigenvalues, and eigenvectors as columns, of a symmetric matrix by Jacobi's rotations.
struct Eigen3 {
  std::array<double, 3> values;
  Matrix3 vectors;
};

inline Eigen3 eigen(Matrix3 s) {
  Matrix3 v{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  constexpr std::array<std::pair<int, int>, 3> kPairs{{{0, 1}, {0, 2}, {1, 2}}};
  constexpr int kSweeps = 8;
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (const auto& [p, q] : kPairs) {
      if (s[p][q] == 0) continue;
      const double theta = (s[q][q] - s[p][p]) / (2 * s[p][q]);
      const double t =
          (theta < 0 ? -1.0 : 1.0) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
      const double c = 1 / std::sqrt(t * t + 1.0), n = t * c;
      for (int k = 0; k < 3; ++k) {
        const double a = s[k][p], b = s[k][q];
        s[k][p] = c * a - n * b, s[k][q] = n * a + c * b;
      }
      for (int k = 0; k < 3; ++k) {
        const double a = s[p][k], b = s[q][k];
        s[p][k] = c * a - n * b, s[q][k] = n * a + c * b;
        const double d = v[k][p], e = v[k][q];
        v[k][p] = c * d - n * e, v[k][q] = n * d + c * e;
      }
    }
  return {{s[0][0], s[1][1], s[2][2]}, v};
}

/// The matrix with the same eigenvectors and its eigenvalues to the power of 1/2, or of -1/2.
inline Matrix3 root(const Eigen3& of, bool is_inverse) {
  Matrix3 result{};
  for (int k = 0; k < 3; ++k) {
    const double r = std::sqrt(of.values[k] > 0 ? of.values[k] : 0.0);
    const Vec3d column{of.vectors[0][k], of.vectors[1][k], of.vectors[2][k]};
    add_square(result, column, is_inverse ? (r > 0 ? 1 / r : 0.0) : r);
  }
  return result;
}

}  // namespace umbel::asset
