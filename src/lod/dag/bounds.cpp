#include "lod/dag/bounds.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "base/math.hpp"

namespace umbel::lod {
namespace {

struct Point {
  double x, y, z;
};

double squared_distance(const Point& a, const Point& b) {
  const double dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
  return dx * dx + dy * dy + dz * dz;
}

double distance(const Point& a, const Point& b) { return std::sqrt(squared_distance(a, b)); }

// Most spheres are, and then nothing needs their distance: true only if, as rounded,
// distance + radius <= of the ball.
bool is_well_inside(const Point& center, double radius, const Point& point, double point_radius) {
  const double room = radius - point_radius;
  return room > 0 && squared_distance(center, point) < room * room * (1 - 1e-9);
}

Point to_point(const Vec3& v) { return {v.x, v.y, v.z}; }

// Ritter (1990): start from the pair that is farthest apart along an axis, then grow just enough
// for each sphere outside. A second, shrunken start usually finds a smaller sphere.
struct Ball {
  Point center;
  double radius;

  void grow(const Point& point, double point_radius) {
    if (is_well_inside(center, radius, point, point_radius)) return;
    const double d = distance(center, point);
    if (d + point_radius <= radius) return;
    if (d + radius <= point_radius) {
      center = point;
      radius = point_radius;
      return;
    }
    const double grown = 0.5 * (d + radius + point_radius);
    const double t = (grown - radius) / d;
    center = {center.x + (point.x - center.x) * t, center.y + (point.y - center.y) * t,
              center.z + (point.z - center.z) * t};
    radius = grown;
  }

  void reach(const Point& point, double point_radius) {
    if (!is_well_inside(center, radius, point, point_radius))
      radius = std::max(radius, distance(center, point) + point_radius);
  }
};

double coordinate(const Vec3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

// Symmetric inputs are served best by the middle of their box.
template <typename Get>
Ball around_box(const size_t (&low)[3], const size_t (&high)[3], size_t count, const Get& get) {
  double middle[3];
  for (int axis = 0; axis < 3; ++axis) {
    const Sphere l = get(low[axis]), h = get(high[axis]);
    middle[axis] = 0.5 * (coordinate(l.center, axis) - l.radius) +
                   0.5 * (coordinate(h.center, axis) + h.radius);
  }
  Ball ball{{middle[0], middle[1], middle[2]}, 0};
  for (size_t i = 0; i < count; ++i) {
    const Sphere s = get(i);
    ball.reach(to_point(s.center), s.radius);
  }
  return ball;
}

template <typename Get>
Ball ritter(size_t count, const Get& get) {
  size_t low[3] = {}, high[3] = {};
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double least[3] = {kInfinity, kInfinity, kInfinity},
         most[3] = {-kInfinity, -kInfinity, -kInfinity};
  for (size_t i = 0; i < count; ++i) {
    const Sphere s = get(i);
    for (int axis = 0; axis < 3; ++axis) {
      const double x = coordinate(s.center, axis);
      if (x - s.radius < least[axis]) least[axis] = x - s.radius, low[axis] = i;
      if (x + s.radius > most[axis]) most[axis] = x + s.radius, high[axis] = i;
    }
  }
  Ball ball{to_point(get(0).center), get(0).radius};
  double widest = -1;
  for (int axis = 0; axis < 3; ++axis) {
    const Sphere a = get(low[axis]), b = get(high[axis]);
    const double width = distance(to_point(a.center), to_point(b.center)) + a.radius + b.radius;
    if (width <= widest) continue;
    widest = width;
    ball = {to_point(a.center), a.radius};
    ball.grow(to_point(b.center), b.radius);
  }
  const Ball boxed = around_box(low, high, count, get);
  for (int round = 0; round < 3; ++round) {
    Ball next = ball;
    next.radius *= 0.9;
    for (size_t i = 0; i < count; ++i) next.grow(to_point(get(i).center), get(i).radius);
    if (round == 0 || next.radius < ball.radius) ball = next;
  }
  return boxed.radius < ball.radius ? boxed : ball;
}

// The centre is rounded to float first and the radius measured from there.
template <typename Get>
Sphere around(size_t count, double margin, const Get& get) {
  const Ball ball = ritter(count, get);
  const Vec3 center{static_cast<float>(ball.center.x), static_cast<float>(ball.center.y),
                    static_cast<float>(ball.center.z)};
  Ball rounded{to_point(center), 0};
  for (size_t i = 0; i < count; ++i) rounded.reach(to_point(get(i).center), get(i).radius);
  return {center, round_up(rounded.radius * (1.0 + margin))};
}

}  // namespace

Sphere bounding_sphere(std::span<const Vec3> points) {
  return around(points.size(), 0.0, [&](size_t i) { return Sphere{points[i], 0.0f}; });
}

Sphere enclosing_sphere(std::span<const Sphere> spheres) {
  return around(spheres.size(), kSphereMargin, [&](size_t i) { return spheres[i]; });
}

}  // namespace umbel::lod
