// A binary tree as the builders from below make it: merges of two subtrees each, in any order,
// which `emit` lays out depth-first as a Bvh2 with one primitive a leaf.
#pragma once

#include <cstdint>
#include <span>

#include "base/big_vector.hpp"
#include "base/math.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {

using Boxes = std::span<const Aabb>;

/// A subtree: a primitive, or the index of the merge that made it.
struct Subtree {
  static constexpr uint32_t kPrimitive = 0x80000000u;

  uint32_t link;
  UMBEL_HOST_DEVICE static Subtree of_primitive(uint32_t primitive) {
    return {primitive | kPrimitive};
  }
  UMBEL_HOST_DEVICE static Subtree of_merge(uint32_t merge) { return {merge}; }
  UMBEL_HOST_DEVICE bool is_primitive() const { return (link & kPrimitive) != 0; }
  UMBEL_HOST_DEVICE uint32_t index() const { return link & ~kPrimitive; }
};

struct Merge {
  Aabb box;
  Subtree left, right;
  uint32_t count;  ///< primitives below
};

/// `merges` has one element fewer than `boxes`, all of them below `root`.
Bvh2 emit(const BigVector<Merge>& merges, Subtree root, Boxes boxes);

/// Half the area of a box that is not empty.
UMBEL_HOST_DEVICE inline float area_of(const Aabb& b) {
  const Vec3 d = b.max - b.min;
  return d.x * d.y + d.z * (d.x + d.y);
}

UMBEL_HOST_DEVICE inline Aabb united(Aabb a, const Aabb& b) {
  extend(a, b);
  return a;
}

/// area_of(united(a, b)), of boxes without NaN; of zeros either may count as the lower one, which
/// is the same area. A device has one instruction for such a minimum, and two for std::min.
UMBEL_HOST_DEVICE inline float united_area(const Aabb& a, const Aabb& b) {
#if defined(__CUDA_ARCH__)
  return area_of({{fminf(a.min.x, b.min.x), fminf(a.min.y, b.min.y), fminf(a.min.z, b.min.z)},
                  {fmaxf(a.max.x, b.max.x), fmaxf(a.max.y, b.max.y), fmaxf(a.max.z, b.max.z)}});
#else
  return area_of(united(a, b));
#endif
}

/// The box of a triangle; empty where a corner is not finite.
UMBEL_HOST_DEVICE inline Aabb box_of_finite(const Vec3& p0, const Vec3& p1, const Vec3& p2) {
  Aabb box;
  if (!is_finite(p0) || !is_finite(p1) || !is_finite(p2)) return box;
  extend(box, p0);
  extend(box, p1);
  extend(box, p2);
  return box;
}

}  // namespace umbel::bvh
