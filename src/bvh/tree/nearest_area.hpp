// The search at the heart of agglomerative clustering: among boxes held as one array a component,
// the one whose union with a given box has the smallest area, four at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "base/exec.hpp"
#include "base/simd/box4.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// Six numbers a box: its low corner and its negated high one, so that a union is a minimum.
struct BoxColumns {
  float* column[6];

  UMBEL_HOST_DEVICE void put(size_t i, const Aabb& b) const {
    column[0][i] = b.min.x, column[1][i] = b.min.y, column[2][i] = b.min.z;
    column[3][i] = -b.max.x, column[4][i] = -b.max.y, column[5][i] = -b.max.z;
  }
  UMBEL_HOST_DEVICE Aabb get(size_t i) const {
    return {{column[0][i], column[1][i], column[2][i]},
            {-column[3][i], -column[4][i], -column[5][i]}};
  }
  UMBEL_HOST_DEVICE void copy(size_t to, size_t from) const {
    for (float* values : column) values[to] = values[from];
  }
};

struct NearestBox {
  float area = std::numeric_limits<float>::infinity();
  uint32_t index = 0;
};

#if defined(__CUDACC__)

/// Among the boxes [begin, end) but `self`; of those as near, the first.
UMBEL_HOST_DEVICE inline NearestBox nearest_box(const BoxColumns& boxes, uint32_t self,
                                                uint32_t begin, uint32_t end) {
  const Aabb box = boxes.get(self);
  NearestBox nearest;
  for (uint32_t i = begin; i < end; ++i) {
    const float area = area_of(united(box, boxes.get(i)));
    if (i != self && area < nearest.area) nearest = {area, i};
  }
  return nearest;
}

#else

/// A box in all four lanes.
struct SplatBox {
  Float4 v[6];
  SplatBox(const BoxColumns& boxes, size_t i) {
    for (int c = 0; c < 6; ++c) v[c] = splat(boxes.column[c][i]);
  }
};

/// Half the area of the union of `a` with each of the boxes [i, i + 4).
inline Float4 united_areas(const SplatBox& a, const BoxColumns& boxes, size_t i) {
  const Float4 x =
      min4(a.v[0], load4(boxes.column[0] + i)) + min4(a.v[3], load4(boxes.column[3] + i));
  const Float4 y =
      min4(a.v[1], load4(boxes.column[1] + i)) + min4(a.v[4], load4(boxes.column[4] + i));
  const Float4 z =
      min4(a.v[2], load4(boxes.column[2] + i)) + min4(a.v[5], load4(boxes.column[5] + i));
  return x * y + z * (x + y);  // of negated extents, which makes no difference
}

inline Float4 select4(Int4 mask, Float4 yes, Float4 no) {
  return Float4((Int4(yes) & mask) | (Int4(no) & ~mask));
}
inline Int4 select4(Int4 mask, Int4 yes, Int4 no) { return (yes & mask) | (no & ~mask); }

/// The least of values that come four at a time; of equal ones, the first.
class LeastOf4 {
 public:
  /// Values of the indices [i, i + 4).
  void add(Float4 values, uint32_t i) {
    const Int4 less = values < least_;
    const auto first = static_cast<int32_t>(i);
    least_ = select4(less, values, least_);
    index_ = select4(less, Int4{first, first + 1, first + 2, first + 3}, index_);
  }
  NearestBox result() const {
    NearestBox best{least_[0], static_cast<uint32_t>(index_[0])};
    for (int lane = 1; lane < 4; ++lane) {
      const auto index = static_cast<uint32_t>(index_[lane]);
      if (least_[lane] < best.area || (least_[lane] == best.area && index < best.index))
        best = {least_[lane], index};
    }
    return best;
  }

 private:
  Float4 least_ = splat(std::numeric_limits<float>::infinity());
  Int4 index_{};
};

/// Infinity in the lanes whose index is `end` or more, or `self`.
inline Float4 without(Float4 values, uint32_t i, uint32_t end, uint32_t self) {
  const auto first = static_cast<int32_t>(i);
  const Int4 index{first, first + 1, first + 2, first + 3};
  const auto last = static_cast<int32_t>(end), own = static_cast<int32_t>(self);
  const Int4 keep = (index < Int4{last, last, last, last}) & (index != Int4{own, own, own, own});
  return select4(keep, values, splat(std::numeric_limits<float>::infinity()));
}

/// Among the boxes [begin, end) but `self`. Three more elements of each column must be readable.
inline NearestBox nearest_box(const BoxColumns& boxes, uint32_t self, uint32_t begin,
                              uint32_t end) {
  const SplatBox box(boxes, self);
  LeastOf4 least;
  for (uint32_t i = begin; i < end; i += 4)
    least.add(without(united_areas(box, boxes, i), i, end, self), i);
  return least.result();
}

#endif

}  // namespace umbel::bvh
