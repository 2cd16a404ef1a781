// Random views to verify cuts with: by error, and by camera from inside and outside the mesh.
#pragma once

#include <cmath>
#include <limits>
#include <span>

#include "base/math.hpp"
#include "umbel/lod/select.hpp"

namespace umbel::lod {

/// SplitMix64 (Steele, Lea & Flood 2014): the same numbers on every platform.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t next() {
    uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double log_between(double low, double high) {
    return std::exp(between(std::log(low), std::log(high)));
  }

 private:
  uint64_t state_;
};

/// The views that the random cuts are seen from.
class ViewMaker {
 public:
  Random& random() { return random_; }
  /// `box` is that of all clusters.
  ViewMaker(std::span<const Group> groups, const Aabb& box, uint32_t seed)
      : groups_(groups), random_(seed) {
    low_[0] = box.min.x, low_[1] = box.min.y, low_[2] = box.min.z;
    high_[0] = box.max.x, high_[1] = box.max.y, high_[2] = box.max.z;
    double square = 0;
    for (int i = 0; i < 3; ++i) square += (high_[i] - low_[i]) * (high_[i] - low_[i]);
    diagonal_ = std::sqrt(square);
    if (!(diagonal_ > 0)) diagonal_ = 1;
    for (const Group& group : groups) {
      if (!std::isfinite(group.error) || !(group.error > 0)) continue;
      smallest_ = smallest_ == 0 ? group.error : std::min<double>(smallest_, group.error);
      largest_ = std::max<double>(largest_, group.error);
    }
    if (largest_ == 0) smallest_ = largest_ = diagonal_;
  }

  /// Half of them by error, half by camera.
  View make(uint32_t index) { return index % 2 == 0 ? by_error() : by_camera(); }

 private:
  View by_error() {
    // Equality is a case of its own, so some of the errors are those of groups.
    if (random_.uniform() < 0.25) {
      const float error = groups_[random_.next() % groups_.size()].error;
      if (std::isfinite(error) && error >= 0) return view_error(error);
    }
    return view_error(static_cast<float>(random_.log_between(smallest_, largest_)));
  }

  View by_camera() {
    double eye[3];
    for (int i = 0; i < 3; ++i) eye[i] = random_.between(low_[i], high_[i]);
    double distance = random_.log_between(0.01, 1) * diagonal_;
    if (random_.uniform() < 0.5) {
      distance = random_.log_between(0.1, 100) * diagonal_;
      const double z = random_.between(-1, 1), angle = random_.between(0, 6.283185307179586);
      const double r = std::sqrt(1 - z * z);
      const double direction[3] = {r * std::cos(angle), r * std::sin(angle), z};
      for (int i = 0; i < 3; ++i)
        eye[i] = 0.5 * (low_[i] + high_[i]) + direction[i] * (0.5 * diagonal_ + distance);
    }
    View view;
    view.kind = View::Kind::kCamera;
    view.eye = {clamped(eye[0]), clamped(eye[1]), clamped(eye[2])};
    view.threshold = std::max(0.0f, clamped(random_.log_between(smallest_, largest_) / distance));
    return view;
  }

  static float clamped(double value) {
    constexpr double kMax = std::numeric_limits<float>::max();
    if (std::isnan(value)) return 0;  // of boxes that are damaged
    return static_cast<float>(std::clamp(value, -kMax, kMax));
  }

  std::span<const Group> groups_;
  Random random_;
  double low_[3], high_[3], diagonal_ = 1, smallest_ = 0, largest_ = 0;
};

}  // namespace umbel::lod
