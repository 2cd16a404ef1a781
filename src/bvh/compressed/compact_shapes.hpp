// Closest points and overlaps of boxes in a compact tree, on processors and devices: the same
// answers as closest_point.hpp and overlap.hpp give.
#pragma once

#include "base/math.hpp"
#include "bvh/compressed/compact_ray.hpp"
#include "query/closest_rules.hpp"

namespace umbel::bvh {

/// Finds the point of the surface that is closest to another.
class ClosestVisitor {
 public:
  /// False where nothing can be found.
  UMBEL_HOST_DEVICE bool begin(const CompactTree& tree, const Vec3& point, float max_distance) {
    tree_ = tree;
    primitive_ = kNone;
    if (tree.info->nodes == 0 || !is_finite(point) || !(max_distance >= 0)) return false;
    point_ = point;
    unit_ = closest::unit_scale(larger(closest::largest_coordinate(point),
                                       larger(closest::largest_coordinate(tree.info->bounds.min),
                                              closest::largest_coordinate(tree.info->bounds.max))));
    scaled_ = point * unit_;
    best_ = {double{max_distance} * max_distance, 0, 0};
    limit_ = closest::box_limit(best_.distance2, unit_);
    return true;
  }

  UMBEL_HOST_DEVICE float limit() const { return limit_; }

  UMBEL_HOST_DEVICE CompactGroup visit(const CompactNode& node) {
    float distance2[8];
    for (float& d : distance2) d = 0;
    for (uint32_t k = 0; k < 3; ++k) {
      const float cell = compact_cell(node.exponent[k]), origin = along(node.origin, k);
      const float at = along(scaled_, k);
      const uint64_t low = slots_of(node.low[k]), high = slots_of(node.high[k]);
      for (uint32_t slot = 0; slot < 8; ++slot) {
        const float below = compact_plane(origin, cell, slot_of(low, slot)) * unit_ - at;
        const float above = at - compact_plane(origin, cell, slot_of(high, slot)) * unit_;
        const float outside = larger(larger(below, above), 0.0f);
        distance2[slot] += outside * outside;
      }
    }
    const uint64_t meta = slots_of(node.meta);
    uint32_t children = 0, first = 0;
    float near = std::numeric_limits<float>::infinity();
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if (slot_of(meta, slot) == 0 || !(distance2[slot] <= limit_)) continue;
      children |= 1u << slot;
      if (distance2[slot] < near) {
        near = distance2[slot];
        first = slot;
      }
    }
    if ((children & ~uint32_t{node.inner}) != 0)
      each_triangle(tree_, node, children, first,
                    [this](const CompactTriangle& triangle, uint32_t position) {
                      take(triangle, position);
                      return true;
                    });
    return CompactGroup::of(node, children, first, near);
  }

  UMBEL_HOST_DEVICE ClosestPoint result() const {
    if (primitive_ == kNone) return {};
    const CompactTriangle triangle = load_words(tree_.triangles + position_);
    return closest::closest_at(best_, primitive_, triangle.p0, triangle.p1, triangle.p2);
  }

 private:
  UMBEL_HOST_DEVICE void take(const CompactTriangle& triangle, uint32_t position) {
    if (!is_finite(triangle.p0) || !is_finite(triangle.p1) || !is_finite(triangle.p2)) return;
    const TrianglePoint p = closest_on_triangle(point_, triangle.p0, triangle.p1, triangle.p2);
    const bool is_closer = p.distance2 < best_.distance2;
    const bool is_equal = p.distance2 == best_.distance2 && triangle.primitive < primitive_;
    if (!is_closer && !is_equal) return;
    best_ = p;
    primitive_ = triangle.primitive;
    position_ = position;
    limit_ = smaller(closest::box_limit(best_.distance2, unit_), limit_);
  }

  CompactTree tree_;
  Vec3 point_, scaled_;
  float unit_ = 1, limit_ = 0;
  TrianglePoint best_;
  uint32_t primitive_ = kNone, position_ = 0;
};

/// Calls found(primitive) for every triangle of a leaf that touches a box.
template <typename Found>
class BoxVisitor {
 public:
  UMBEL_HOST_DEVICE explicit BoxVisitor(const Found& found) : found_(found) {}

  /// False where nothing can be found.
  UMBEL_HOST_DEVICE bool begin(const CompactTree& tree, const Aabb& box) {
    tree_ = tree;
    box_ = finite_part(box);
    // Written so that a NaN fails.
    return tree.info->nodes > 0 && box_.min.x <= box_.max.x && box_.min.y <= box_.max.y &&
           box_.min.z <= box_.max.z;
  }

  UMBEL_HOST_DEVICE static float limit() { return 1; }

  UMBEL_HOST_DEVICE CompactGroup visit(const CompactNode& node) const {
    uint32_t apart = 0;
    for (uint32_t k = 0; k < 3; ++k) {
      const float cell = compact_cell(node.exponent[k]), origin = along(node.origin, k);
      const uint64_t low = slots_of(node.low[k]), high = slots_of(node.high[k]);
      for (uint32_t slot = 0; slot < 8; ++slot)
        if (compact_plane(origin, cell, slot_of(low, slot)) > along(box_.max, k) ||
            compact_plane(origin, cell, slot_of(high, slot)) < along(box_.min, k))
          apart |= 1u << slot;
    }
    const uint64_t meta = slots_of(node.meta);
    uint32_t children = 0;
    for (uint32_t slot = 0; slot < 8; ++slot)
      if (slot_of(meta, slot) != 0 && (apart >> slot & 1) == 0) children |= 1u << slot;
    each_triangle(tree_, node, children, 0, [this](const CompactTriangle& t, uint32_t) {
      if (is_finite(t.p0) && is_finite(t.p1) && is_finite(t.p2) &&
          touches_box(box_, t.p0, t.p1, t.p2))
        found_(t.primitive);
      return true;
    });
    return CompactGroup::of(node, children, 0, 0);
  }

 private:
  CompactTree tree_;
  Aabb box_;
  Found found_;
};

}  // namespace umbel::bvh
