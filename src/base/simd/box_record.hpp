// A box as two vectors of four floats, so that a union is two minimums: {min.xyz, tag} and
// {-max.xyz, 0}. The tag may carry an item's index; unions leave garbage there.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

#include "umbel/types.hpp"

namespace umbel::cluster {

/// Four floats on which arithmetic works lane by lane (an extension of GCC and Clang).
typedef float Float4 __attribute__((vector_size(16)));
/// May alias a BoxRecord.
typedef float Float8 __attribute__((vector_size(32), may_alias));
typedef int32_t Int4 __attribute__((vector_size(16)));

inline Float4 min4(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 max4(Float4 a, Float4 b) { return a > b ? a : b; }
inline Float4 splat(float x) { return Float4{x, x, x, x}; }

struct alignas(32) BoxRecord {
  Float4 low;
  Float4 negated_high;

  static BoxRecord empty() {
    constexpr float kBig = std::numeric_limits<float>::max();
    return {splat(kBig), splat(kBig)};
  }
  static BoxRecord from(const Aabb& b) {
    return {Float4{b.min.x, b.min.y, b.min.z, 0}, Float4{-b.max.x, -b.max.y, -b.max.z, 0}};
  }
  void extend(const BoxRecord& o) {
    low = min4(low, o.low);
    negated_high = min4(negated_high, o.negated_high);
  }
  void intersect(const BoxRecord& o) {
    low = max4(low, o.low);
    negated_high = max4(negated_high, o.negated_high);
  }
  /// By a power of two; keeps the tag.
  void scale(float s) {
    const uint32_t old = tag();
    low *= splat(s);
    negated_high *= splat(s);
    set_tag(old);
  }
  float extent(int axis) const { return -(low[axis] + negated_high[axis]); }
  float longest() const { return std::max({extent(0), extent(1), extent(2)}); }
  float center(int axis) const { return low[axis] * 0.5f - negated_high[axis] * 0.5f; }

  uint32_t tag() const { return std::bit_cast<uint32_t>(float(low[3])); }
  void set_tag(uint32_t tag) { low[3] = std::bit_cast<float>(tag); }
  BoxRecord tagged(uint32_t tag) const {
    return {Float4{low[0], low[1], low[2], std::bit_cast<float>(tag)}, negated_high};
  }

  /// Half the area of the box after it has grown by `pad` in each direction. A little padding
  /// makes boxes without area, those of points on one line, comparable by their length.
  float half_area(Float4 pad) const {
    const Float4 e = pad - (low + negated_high);
    const Float4 p = e * __builtin_shufflevector(e, e, 1, 2, 0, 3);
    return p[0] + p[1] + p[2];
  }
};

/// Whether two boxes are the same, whatever their tags.
inline bool same_box(const BoxRecord& a, const BoxRecord& b) {
  for (int k = 0; k < 3; ++k)
    if (a.low[k] != b.low[k] || a.negated_high[k] != b.negated_high[k]) return false;
  return true;
}

}  // namespace umbel::cluster
