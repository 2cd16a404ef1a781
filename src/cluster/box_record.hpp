// A box as eight floats, so that a union is one minimum: {min.xyz, 0, -max.xyz, 0}.
#pragma once

#include <algorithm>
#include <limits>

#include "umbel/types.hpp"

namespace umbel::cluster {

struct alignas(32) BoxRecord {
  float v[8];

  static BoxRecord empty() {
    constexpr float kBig = std::numeric_limits<float>::max();
    return {{kBig, kBig, kBig, 0, kBig, kBig, kBig, 0}};
  }
  static BoxRecord from(const Aabb& b) {
    return {{b.min.x, b.min.y, b.min.z, 0, -b.max.x, -b.max.y, -b.max.z, 0}};
  }
  void extend(const BoxRecord& o) {
    for (int k = 0; k < 8; ++k) v[k] = std::min(v[k], o.v[k]);
  }
  void intersect(const BoxRecord& o) {
    for (int k = 0; k < 8; ++k) v[k] = std::max(v[k], o.v[k]);
  }
  void scale(float s) {
    for (int k = 0; k < 8; ++k) v[k] *= s;
  }
  float extent(int axis) const { return -(v[axis] + v[4 + axis]); }
  float center(int axis) const { return v[axis] * 0.5f - v[4 + axis] * 0.5f; }

  /// Half the area of the box after it has grown by `pad` in each direction. A little padding
  /// makes boxes without area, those of points on one line, comparable by their length.
  float half_area(float pad) const {
    const float x = pad + extent(0), y = pad + extent(1), z = pad + extent(2);
    return x * y + y * z + z * x;
  }
};

}  // namespace umbel::cluster
