// The boxes of the two parts into which a plane splits what lies of a triangle in a cell ("perfect
// splits", Havran & Bittner 2002; polygons clipped after Sutherland & Hodgman 1974). Computed in
// double and rounded to the nearest float, half a unit in the last place, which is far below what
// rays allow for (see query/ray_frame.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "base/math.hpp"
#include "kdtree/split_cost.hpp"
#include "query/leaf_lists.hpp"

namespace umbel::kdtree {

namespace detail {

struct ClipPoint {
  double at[3];
};

/// A triangle clipped by six planes has at most nine corners.
struct ClipPolygon {
  std::array<ClipPoint, 10> points;
  uint32_t count = 0;
  void push(const ClipPoint& p) {
    if (count < points.size()) points[count++] = p;
  }
};

inline ClipPoint crossing(const ClipPoint& p, const ClipPoint& q, uint32_t axis, double plane) {
  const double s = (plane - p.at[axis]) / (q.at[axis] - p.at[axis]);
  ClipPoint c;
  for (uint32_t a = 0; a < 3; ++a) c.at[a] = p.at[a] + (q.at[a] - p.at[a]) * s;
  c.at[axis] = plane;
  return c;
}

/// Keeps what lies where sign * coordinate <= sign * plane.
inline void clip(ClipPolygon& polygon, uint32_t axis, double sign, double plane) {
  ClipPolygon kept;
  for (uint32_t i = 0; i < polygon.count; ++i) {
    const ClipPoint& p = polygon.points[i];
    const ClipPoint& q = polygon.points[i + 1 == polygon.count ? 0 : i + 1];
    const double a = sign * (p.at[axis] - plane), b = sign * (q.at[axis] - plane);
    if (a <= 0) kept.push(p);
    if ((a < 0 && b > 0) || (a > 0 && b < 0)) kept.push(crossing(p, q, axis, plane));
  }
  polygon = kept;
}

/// How far beyond a face at `at` a triangle is kept whose largest coordinate is `max_abs_coord`. A
/// box that was rounded to the face may have brought it into the cell: clipped at the face itself,
/// all but its corner there would be lost.
inline double clip_error_bound(float at, double max_abs_coord) {
  return std::fabs(double{at}) * 0x1p-22 + max_abs_coord * 0x1p-40;
}

inline ClipPolygon clipped(const TriangleCorners& corners, const Aabb& cell) {
  ClipPolygon polygon;
  Aabb box;
  for (const Vec3& c : corners) {
    polygon.push({{c.x, c.y, c.z}});
    extend(box, c);
  }
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const float low = component(cell.min, axis), high = component(cell.max, axis);
    const double least = component(box.min, axis), most = component(box.max, axis);
    const double max_abs = std::max(std::fabs(least), std::fabs(most));
    const double floor = low - clip_error_bound(low, max_abs);
    const double ceiling = high + clip_error_bound(high, max_abs);
    if (least < floor) clip(polygon, axis, -1, floor);
    if (most > ceiling) clip(polygon, axis, 1, ceiling);
  }
  return polygon;
}

struct ClipBox {
  double low[3] = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                   std::numeric_limits<double>::infinity()};
  double high[3] = {-std::numeric_limits<double>::infinity(),
                    -std::numeric_limits<double>::infinity(),
                    -std::numeric_limits<double>::infinity()};
  void extend(const ClipPoint& p) {
    for (uint32_t a = 0; a < 3; ++a) {
      low[a] = p.at[a] < low[a] ? p.at[a] : low[a];
      high[a] = p.at[a] > high[a] ? p.at[a] : high[a];
    }
  }
  /// Within `cell`; empty where it was never extended.
  Aabb within(const Aabb& cell) const {
    Aabb box;
    if (!(low[0] <= high[0])) return box;
    for (uint32_t a = 0; a < 3; ++a) {
      const float least = component(cell.min, a), most = component(cell.max, a);
      component(box.min, a) = std::clamp(static_cast<float>(low[a]), least, most);
      component(box.max, a) = std::clamp(static_cast<float>(high[a]), least, most);
    }
    return box;
  }
};

}  // namespace detail

struct Halves {
  Aabb below, above;  ///< empty where nothing of the triangle lies there
};

inline Halves clip_triangle(const TriangleCorners& corners, const Aabb& cell, const Split& split) {
  const detail::ClipPolygon polygon = detail::clipped(corners, cell);
  const uint32_t axis = split.axis;
  const double plane = split.at;
  detail::ClipBox below, above;
  for (uint32_t i = 0; i < polygon.count; ++i) {
    const detail::ClipPoint& p = polygon.points[i];
    const detail::ClipPoint& q = polygon.points[i + 1 == polygon.count ? 0 : i + 1];
    if (p.at[axis] <= plane) below.extend(p);
    if (p.at[axis] >= plane) above.extend(p);
    if ((p.at[axis] < plane && q.at[axis] > plane) || (p.at[axis] > plane && q.at[axis] < plane)) {
      const detail::ClipPoint c = detail::crossing(p, q, axis, plane);
      below.extend(c);
      above.extend(c);
    }
  }
  return {below.within(cell_below(cell, split)), above.within(cell_above(cell, split))};
}

/// Of a triangle that reaches into the cell and to both sides of the plane. Where rounding leaves
/// nothing of it, the parts of its box: no triangle is lost.
inline Halves halves_of(const MeshView& mesh, uint32_t triangle, const Aabb& cell,
                        const Split& split) {
  const TriangleCorners corners = corners_of(mesh, triangle);
  Halves halves = clip_triangle(corners, cell, split);
  if (!is_empty(halves.below) || !is_empty(halves.above)) return halves;
  Aabb box;
  for (const Vec3& c : corners) extend(box, c);
  const auto common = [&](const Aabb& part) {
    return Aabb{max(box.min, part.min), min(box.max, part.max)};
  };
  return {common(cell_below(cell, split)), common(cell_above(cell, split))};
}

/// What a tree is built over: the triangles of a mesh, or boxes.
class Primitives {
 public:
  explicit Primitives(const MeshView& mesh) : mesh_(&mesh) {}
  explicit Primitives(std::span<const Aabb> boxes) : boxes_(boxes) {}

  /// Of a primitive that reaches into the cell and to both sides of the plane.
  Halves halves(uint32_t primitive, const Aabb& cell, const Split& split) const {
    if (mesh_) return halves_of(*mesh_, primitive, cell, split);
    return {part(primitive, cell_below(cell, split)), part(primitive, cell_above(cell, split))};
  }

 private:
  Aabb part(uint32_t primitive, const Aabb& cell) const {
    return {max(boxes_[primitive].min, cell.min), min(boxes_[primitive].max, cell.max)};
  }

  const MeshView* mesh_ = nullptr;
  std::span<const Aabb> boxes_;
};

}  // namespace umbel::kdtree
