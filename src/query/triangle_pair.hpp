// Exactly whether two triangles have a point in common, by the signs of orientation.hpp alone, as
// Guigue & Devillers, "Fast and Robust Triangle-Triangle Overlap Test Using Orientation Predicates"
// (2003), decide it. Triangles are closed: touching counts, also in one plane, and so do triangles
// that are only a segment or a point.
//
// What two triangles have in common is convex, and its corners lie on an edge of one of them. So
// they meet where an edge of one meets the other.
#pragma once

#include <algorithm>
#include <array>

#include "query/orientation.hpp"

namespace umbel {
namespace detail {

using orientation::orient2d;
using orientation::orient3d;
using orientation::Point2;

using PairCorners = std::array<Vec3, 3>;

/// Without the coordinate of an axis.
inline Point2 projected(const Vec3& p, uint32_t axis) {
  if (axis == 0) return {p.y, p.z};
  return axis == 1 ? Point2{p.z, p.x} : Point2{p.x, p.y};
}

inline bool intervals_meet(float a, float b, float c, float d) {
  return std::max(a, b) >= std::min(c, d) && std::max(c, d) >= std::min(a, b);
}

/// Closed segments of a plane; points are segments too.
inline bool segments_meet(const Point2& p, const Point2& q, const Point2& r, const Point2& s) {
  const int rs_p = orient2d(r, s, p), rs_q = orient2d(r, s, q);
  if (rs_p * rs_q > 0) return false;
  const int pq_r = orient2d(p, q, r), pq_s = orient2d(p, q, s);
  if (pq_r * pq_s > 0) return false;
  if (rs_p != 0 || rs_q != 0 || pq_r != 0 || pq_s != 0) return true;
  return intervals_meet(p.x, q.x, r.x, s.x) && intervals_meet(p.y, q.y, r.y, s.y);
}

/// Closed segments of space. Those of one plane meet where all of their projections do: one of the
/// projections at least does not fold the plane, or the line that they all lie on.
inline bool segments_meet(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
  if (orient3d(p, q, r, s) != 0) return false;
  for (uint32_t axis = 0; axis < 3; ++axis)
    if (!segments_meet(projected(p, axis), projected(q, axis), projected(r, axis),
                       projected(s, axis)))
      return false;
  return true;
}

inline bool has_both_signs(int a, int b, int c) {
  return (a > 0 || b > 0 || c > 0) && (a < 0 || b < 0 || c < 0);
}

/// A segment in the plane of a triangle whose projection along `axis` has an area.
inline bool flat_segment_meets(const Vec3& p, const Vec3& q, const PairCorners& t, uint32_t axis) {
  const Point2 a = projected(t[0], axis), b = projected(t[1], axis), c = projected(t[2], axis);
  const Point2 from = projected(p, axis), to = projected(q, axis);
  if (!has_both_signs(orient2d(a, b, from), orient2d(b, c, from), orient2d(c, a, from)))
    return true;
  return segments_meet(from, to, a, b) || segments_meet(from, to, b, c) ||
         segments_meet(from, to, c, a);
}

/// The axis along which the triangle's projection has an area; 3 where it is only a segment or a
/// point.
inline uint32_t projection_axis(const PairCorners& t) {
  for (uint32_t axis = 0; axis < 3; ++axis)
    if (orient2d(projected(t[0], axis), projected(t[1], axis), projected(t[2], axis)) != 0)
      return axis;
  return 3;
}

/// A triangle, and on which sides of its plane the corners of another are.
struct Sides {
  const PairCorners& triangle;
  uint32_t axis;  ///< see projection_axis
  int of[3] = {};

  Sides(const PairCorners& t, const PairCorners& other) : triangle(t), axis(projection_axis(t)) {
    if (axis == 3) return;  // of no plane; all lie in it
    for (uint32_t i = 0; i < 3; ++i) of[i] = orient3d(t[0], t[1], t[2], other[i]);
  }
  bool are_apart() const {
    return (of[0] > 0 && of[1] > 0 && of[2] > 0) || (of[0] < 0 && of[1] < 0 && of[2] < 0);
  }
};

/// Whether the edge from corner i to corner k of the other triangle meets the triangle.
inline bool edge_meets(const Sides& sides, const PairCorners& other, uint32_t i, uint32_t k) {
  const auto& [a, b, c] = sides.triangle;
  const Vec3 &p = other[i], &q = other[k];
  if (sides.axis == 3)
    return segments_meet(p, q, a, b) || segments_meet(p, q, b, c) || segments_meet(p, q, c, a);
  if (sides.of[i] * sides.of[k] > 0) return false;
  if (sides.of[i] == 0 && sides.of[k] == 0)
    return flat_segment_meets(p, q, sides.triangle, sides.axis);
  // The line through both goes through the plane at one point, which lies between them.
  return !has_both_signs(orient3d(p, q, a, b), orient3d(p, q, b, c), orient3d(p, q, c, a));
}

inline bool any_edge_meets(const Sides& sides, const PairCorners& other) {
  return edge_meets(sides, other, 0, 1) || edge_meets(sides, other, 1, 2) ||
         edge_meets(sides, other, 2, 0);
}

}  // namespace detail

/// Corners must be finite.
inline bool triangles_meet(const std::array<Vec3, 3>& first, const std::array<Vec3, 3>& second) {
  const detail::Sides of_first(first, second);
  if (of_first.are_apart()) return false;
  const detail::Sides of_second(second, first);
  if (of_second.are_apart()) return false;
  return detail::any_edge_meets(of_first, second) || detail::any_edge_meets(of_second, first);
}

}  // namespace umbel
