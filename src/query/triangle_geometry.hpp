// What one triangle answers besides rays: its point closest to another (by Voronoi regions of the
// plane, Ericson, "Real-Time Collision Detection", 2005, section 5.1.5), and whether it touches a
// box (separating axes, Akenine-Moeller, "Fast 3D Triangle-Box Overlap Testing", 2001) or a
// sphere. Corners are floats and the arithmetic is double, so no scale overflows or underflows,
// and degenerate triangles are the segments and points that they look like.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/host_device.hpp"
#include "base/math.hpp"
#include "query/orientation.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// The point (1 - u - v) p0 + u p1 + v p2 of a triangle, and its squared distance.
struct TrianglePoint {
  double distance2, u, v;
};

namespace detail {

struct SegmentPoint {
  double distance2, t;
};

/// The point a + t (b - a) of a segment that is closest to the origin.
UMBEL_HOST_DEVICE inline SegmentPoint closest_on_segment(const Vec3d& a, const Vec3d& b) {
  const Vec3d along = b - a;
  const double squared = dot(along, along);
  // A quotient of a denormal may be anything, and then an end is as good.
  const double t = squared > 0 ? std::clamp(-dot(a, along) / squared, 0.0, 1.0) : 0.0;
  const Vec3d point = a + along * t;
  // An end is that very corner, however the sum above rounds: so edges agree on shared corners.
  if (t == 1) return {dot(b, b), 1};
  return {dot(point, point), t};
}

}  // namespace detail

/// The point of triangle a, b, c that is closest to the origin.
UMBEL_HOST_DEVICE inline TrianglePoint closest_on_triangle(const Vec3d& a, const Vec3d& b,
                                                           const Vec3d& c) {
  const Vec3d ab = b - a, ac = c - a;
  const Vec3d normal = cross(ab, ac);
  const double squared = dot(normal, normal);
  // Below this the normal is made of rounding errors, and the triangle is as thin as its edges.
  constexpr double kThin = 1e-26;
  const double u = dot(normal, cross(c, a)), v = dot(normal, cross(a, b));
  const double w = dot(normal, cross(b, c));
  // Their sum is `squared`, but nothing may be left of them where the triangle is very far away.
  const double sum = u + v + w;
  const bool thin = !(squared > kThin * dot(ab, ab) * dot(ac, ac) && sum > 0);
  if (!thin && u >= 0 && v >= 0 && w >= 0) {
    const double scale = 1 / sum;
    const Vec3d point = a + ab * (u * scale) + ac * (v * scale);
    return {dot(point, point), u * scale, v * scale};
  }
  // A triangle is convex, so the closest point lies on an edge that the foot is beyond.
  TrianglePoint best{std::numeric_limits<double>::infinity(), 0, 0};
  if (thin || v < 0) {
    const auto s = detail::closest_on_segment(a, b);
    best = {s.distance2, s.t, 0};
  }
  if (thin || w < 0) {
    const auto s = detail::closest_on_segment(b, c);
    if (s.distance2 < best.distance2) best = {s.distance2, 1 - s.t, s.t};
  }
  if (thin || u < 0) {
    const auto s = detail::closest_on_segment(c, a);
    if (s.distance2 < best.distance2) best = {s.distance2, 0, 1 - s.t};
  }
  return best;
}

/// The point of triangle p0, p1, p2 that is closest to `point`.
UMBEL_HOST_DEVICE inline TrianglePoint closest_on_triangle(const Vec3& point, const Vec3& p0,
                                                           const Vec3& p1, const Vec3& p2) {
  const Vec3d p = to_double(point);
  return closest_on_triangle(to_double(p0) - p, to_double(p1) - p, to_double(p2) - p);
}

/// Touching counts. Not for a negative radius or one that is NaN.
UMBEL_HOST_DEVICE inline bool touches_sphere(const Sphere& sphere, const Vec3& p0, const Vec3& p1,
                                             const Vec3& p2) {
  if (!(sphere.radius >= 0)) return false;
  const double radius = sphere.radius;
  return closest_on_triangle(sphere.center, p0, p1, p2).distance2 <= radius * radius;
}

namespace detail {

/// Whether the line through a and b has the rectangle strictly on the side where the triangle a,
/// b, c is not. Together with the rectangle's own sides these lines decide whether the projections
/// of a triangle and a box meet.
UMBEL_HOST_DEVICE inline bool separated_by_edge(const orientation::Point2& a,
                                                const orientation::Point2& b,
                                                const orientation::Point2& c,
                                                const orientation::Point2& low,
                                                const orientation::Point2& high) {
  using orientation::orient2d;
  if (a.x == b.x && a.y == b.y) return false;
  const int first = orient2d(a, b, low);
  if (first == 0 || first == orient2d(a, b, c)) return false;
  return orient2d(a, b, high) == first && orient2d(a, b, {low.x, high.y}) == first &&
         orient2d(a, b, {high.x, low.y}) == first;
}

UMBEL_HOST_DEVICE inline bool separated_in_projection(const orientation::Point2& a,
                                                      const orientation::Point2& b,
                                                      const orientation::Point2& c,
                                                      const orientation::Point2& low,
                                                      const orientation::Point2& high) {
  return separated_by_edge(a, b, c, low, high) || separated_by_edge(b, c, a, low, high) ||
         separated_by_edge(c, a, b, low, high);
}

UMBEL_HOST_DEVICE inline bool separated_by_plane(const Aabb& box, const Vec3& p0, const Vec3& p1,
                                                 const Vec3& p2) {
  int first = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p{corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                 corner & 4 ? box.max.z : box.min.z};
    const int side = orientation::orient3d(p0, p1, p2, p);
    if (side == 0 || side == -first) return false;
    first = side;
  }
  return true;
}

}  // namespace detail

/// The part of a box where points are finite. A box with a NaN keeps it, and one that lies beyond
/// becomes empty.
UMBEL_HOST_DEVICE inline Aabb finite_part(const Aabb& box) {
  constexpr float kMost = std::numeric_limits<float>::max();
  return {max(box.min, {-kMost, -kMost, -kMost}), min(box.max, {kMost, kMost, kMost})};
}

/// Exactly whether a triangle and a closed box have a point in common. Not for an empty box or one
/// that is infinite.
UMBEL_HOST_DEVICE inline bool touches_box(const Aabb& box, const Vec3& p0, const Vec3& p1,
                                          const Vec3& p2) {
  if (!(box.min.x <= box.max.x && box.min.y <= box.max.y && box.min.z <= box.max.z)) return false;
  const auto apart = [](float a, float b, float c, float low, float high) {
    return std::max({a, b, c}) < low || std::min({a, b, c}) > high;
  };
  if (apart(p0.x, p1.x, p2.x, box.min.x, box.max.x) ||
      apart(p0.y, p1.y, p2.y, box.min.y, box.max.y) ||
      apart(p0.z, p1.z, p2.z, box.min.z, box.max.z))
    return false;
  using detail::separated_in_projection;
  const Vec3 &low = box.min, &high = box.max;
  return !separated_in_projection({p0.x, p0.y}, {p1.x, p1.y}, {p2.x, p2.y}, {low.x, low.y},
                                  {high.x, high.y}) &&
         !separated_in_projection({p0.y, p0.z}, {p1.y, p1.z}, {p2.y, p2.z}, {low.y, low.z},
                                  {high.y, high.z}) &&
         !separated_in_projection({p0.z, p0.x}, {p1.z, p1.x}, {p2.z, p2.x}, {low.z, low.x},
                                  {high.z, high.x}) &&
         !detail::separated_by_plane(box, p0, p1, p2);
}

}  // namespace umbel
