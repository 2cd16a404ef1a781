// A box as two vectors of four floats, {min.xyz, tag} and {-max.xyz, 0}, so that a union is two
// minimums. The tag may carry an item's index; unions leave garbage in it.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

#include "base/simd/float4.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// Aligned, so that it can be loaded as one vector of eight.
struct alignas(32) Box4 {
  Float4 low;
  Float4 negated_high;

  static Box4 empty() {
    constexpr float kBig = std::numeric_limits<float>::max();
    return {splat(kBig), splat(kBig)};
  }
  static Box4 from(const Aabb& b) {
    return {Float4{b.min.x, b.min.y, b.min.z, 0}, Float4{-b.max.x, -b.max.y, -b.max.z, 0}};
  }
  /// The same but for lane 3, which has no meaning then.
  static Box4 load(const Aabb& b) {
#if defined(__SSE2__)
    static_assert(sizeof(Aabb) == 24);
    const __m128 z_and_max = _mm_loadu_ps(&b.min.z);
    return {Float4(_mm_loadu_ps(&b.min.x)),
            -Float4(_mm_shuffle_ps(z_and_max, z_and_max, _MM_SHUFFLE(0, 3, 2, 1)))};
#else
    return from(b);
#endif
  }
  Aabb box() const {
    return {{low[0], low[1], low[2]}, {-negated_high[0], -negated_high[1], -negated_high[2]}};
  }

  void extend(const Box4& o) {
    low = min4(low, o.low);
    negated_high = min4(negated_high, o.negated_high);
  }
  void intersect(const Box4& o) {
    low = max4(low, o.low);
    negated_high = max4(negated_high, o.negated_high);
  }

  Float4 extents() const { return -(low + negated_high); }
  float extent(int axis) const { return -(low[axis] + negated_high[axis]); }
  float longest() const { return std::max({extent(0), extent(1), extent(2)}); }
  /// Twice the centre.
  Float4 center2() const { return low - negated_high; }
  float center(int axis) const { return low[axis] * 0.5f - negated_high[axis] * 0.5f; }

  /// Half the area of the box after each extent has grown by `pad`. A little padding makes boxes
  /// without area, those of points on one line, comparable by their length.
  float half_area(Float4 pad) const {
    const Float4 e = pad - (low + negated_high);
    const Float4 p = e * __builtin_shufflevector(e, e, 1, 2, 0, 3);
    return p[0] + p[1] + p[2];
  }
  /// Padding that is far below what the extents can resolve.
  Float4 pad() const {
    const Float4 e = extents();
    const float longest = e[0] > e[1] ? (e[0] > e[2] ? e[0] : e[2]) : (e[1] > e[2] ? e[1] : e[2]);
    return splat(longest * 0x1p-22f);
  }

  uint32_t tag() const { return std::bit_cast<uint32_t>(float(low[3])); }
  void set_tag(uint32_t tag) { low[3] = std::bit_cast<float>(tag); }
  Box4 tagged(uint32_t tag) const {
    return {Float4{low[0], low[1], low[2], std::bit_cast<float>(tag)}, negated_high};
  }
  /// By a power of two; keeps the tag.
  void scale(float s) {
    const uint32_t old = tag();
    low *= splat(s);
    negated_high *= splat(s);
    set_tag(old);
  }
};

/// May alias a Box4.
typedef float Float8 __attribute__((vector_size(32), may_alias));

/// Whether two boxes are the same, whatever their tags.
inline bool same_box(const Box4& a, const Box4& b) {
  for (int k = 0; k < 3; ++k)
    if (a.low[k] != b.low[k] || a.negated_high[k] != b.negated_high[k]) return false;
  return true;
}

}  // namespace umbel
