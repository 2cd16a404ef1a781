// What an instance's transform does to a view: doubles, with no operation but those that are
// rounded alike everywhere (no hypot), so that a device has the same views to the last bit.
#pragma once

#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "base/host_device.hpp"
#include "base/math.hpp"
#include "lod/select/cull.hpp"

namespace umbel::lod {

/// The least and the largest factor by which a transform changes lengths.
struct Stretch {
  double least, most;
};
/// Throws kInvalidArgument where the transform is not finite and invertible.
Stretch stretch(const Transform& transform);
/// The largest of them, also of a transform that flattens things. Throws where it is not finite.
double largest_stretch(const Transform& transform);

/// An error or a threshold of a view in an instance's space, never infinite.
UMBEL_HOST_DEVICE inline float scaled(float value, double factor) {
  return static_cast<float>(
      std::min<double>(value * factor, double{std::numeric_limits<float>::max()}));
}

/// A transform, taken apart.
class InstanceSpace {
 public:
  UMBEL_HOST_DEVICE explicit InstanceSpace(const Transform& transform) {
    is_finite_ = true;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) m_[i][j] = double{transform.rows[4 * i + j]};
      move_[i] = double{transform.rows[4 * i + 3]};
      for (int j = 0; j < 4; ++j)
        is_finite_ = is_finite_ && std::isfinite(transform.rows[4 * i + j]);
    }
    // The inverse's columns are the cross products of the rows over the determinant.
    for (int k = 0; k < 3; ++k) cross(m_[(k + 1) % 3], m_[(k + 2) % 3], columns_[k]);
    determinant_ = dot(m_[0], columns_[0]);
    double values[3];
    eigenvalues_of_square(values);
    const double low = least_of(values), high = -least_of_negative(values);
    is_invertible_ = is_finite_ && low > 0 && determinant_ != 0;
    most_ = is_finite_ && high > 0 ? std::sqrt(high) : 0;
    stretch_ = is_invertible_ ? Stretch{std::sqrt(low), std::sqrt(high)} : Stretch{1, 1};
  }

  UMBEL_HOST_DEVICE bool is_finite() const { return is_finite_; }
  UMBEL_HOST_DEVICE bool is_invertible() const { return is_invertible_; }
  /// The largest factor by which the transform changes lengths, also if it flattens things; more
  /// than 0, and 0 only if it is not finite.
  UMBEL_HOST_DEVICE double most() const {
    constexpr double kLeast = 1e-30;
    return is_finite_ && most_ < kLeast ? kLeast : most_;
  }
  UMBEL_HOST_DEVICE double determinant() const { return determinant_; }
  UMBEL_HOST_DEVICE Stretch stretch() const { return stretch_; }

  /// The view of the scene as the instance's own space has it; its eye may not be finite.
  UMBEL_HOST_DEVICE View view(const View& scene) const {
    View result = scene;
    if (scene.kind == View::Kind::kError) result.error = scaled(scene.error, 1 / stretch_.most);
    if (scene.kind != View::Kind::kCamera) return result;
    result.threshold = scaled(scene.threshold, stretch_.least / stretch_.most);
    const double from[3] = {double{scene.eye.x} - move_[0], double{scene.eye.y} - move_[1],
                            double{scene.eye.z} - move_[2]};
    float eye[3];
    for (int i = 0; i < 3; ++i)
      eye[i] = static_cast<float>(
          (columns_[0][i] * from[0] + columns_[1][i] * from[1] + columns_[2][i] * from[2]) /
          determinant_);
    result.eye = {eye[0], eye[1], eye[2]};
    return result;
  }

  /// The same half-space.
  UMBEL_HOST_DEVICE Plane plane(const Plane& scene) const {
    const double world[3] = {double{scene.normal.x}, double{scene.normal.y},
                             double{scene.normal.z}};
    double normal[3] = {0, 0, 0};
    double offset = double{scene.offset};
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) normal[i] += m_[k][i] * world[k];
      offset += world[i] * move_[i];
    }
    const double length = std::sqrt(dot(normal, normal));
    return {{static_cast<float>(normal[0] / length), static_cast<float>(normal[1] / length),
             static_cast<float>(normal[2] / length)},
            static_cast<float>(offset / length)};
  }

 private:
  UMBEL_HOST_DEVICE static void cross(const double* a, const double* b, double* out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
  }
  UMBEL_HOST_DEVICE static double dot(const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
  UMBEL_HOST_DEVICE static double least_of(const double* v) {
    const double two = v[1] < v[0] ? v[1] : v[0];
    return v[2] < two ? v[2] : two;
  }
  UMBEL_HOST_DEVICE static double least_of_negative(const double* v) {
    const double negative[3] = {-v[0], -v[1], -v[2]};
    return least_of(negative);
  }

  // The eigenvalues of the transpose times the matrix by Jacobi's rotations, which keep small ones
  // accurate.
  UMBEL_HOST_DEVICE void eigenvalues_of_square(double* values) const {
    double s[3][3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k) s[i][j] += m_[k][i] * m_[k][j];
    for (int sweep = 0; sweep < 12; ++sweep) {
      rotate(s, 0, 1);
      rotate(s, 0, 2);
      rotate(s, 1, 2);
    }
    for (int i = 0; i < 3; ++i) values[i] = s[i][i];
  }
  UMBEL_HOST_DEVICE static void rotate(double s[3][3], int p, int q) {
    if (s[p][q] == 0) return;
    const double theta = (s[q][q] - s[p][p]) / (2 * s[p][q]);
    // Where the square overflows the rotation is by nothing that can be seen.
    const double t = (theta < 0 ? -1.0 : 1.0) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
    const double cosine = 1 / std::sqrt(t * t + 1.0), sine = t * cosine;
    for (int k = 0; k < 3; ++k) {
      const double a = s[k][p], b = s[k][q];
      s[k][p] = cosine * a - sine * b;
      s[k][q] = sine * a + cosine * b;
    }
    for (int k = 0; k < 3; ++k) {
      const double a = s[p][k], b = s[q][k];
      s[p][k] = cosine * a - sine * b;
      s[q][k] = sine * a + cosine * b;
    }
  }

  double m_[3][3], columns_[3][3], move_[3], determinant_, most_;
  Stretch stretch_;
  bool is_finite_, is_invertible_;
};

std::vector<Plane> to_object(std::span<const Plane> planes, const Transform& transform);

/// Returns make(). The message of an Error that it throws begins with the instance's number.
template <typename Make>
auto of_instance(size_t index, const Make& make) {
  try {
    return make();
  } catch (const Error& error) {
    throw Error(error.code(), "instance " + std::to_string(index) + ": " + error.what());
  }
}

/// One cut an instance, one after the other. Throws kUnsupported where they are too many clusters.
InstanceCuts join_cuts(std::span<const std::vector<uint32_t>> cuts);

}  // namespace umbel::lod
