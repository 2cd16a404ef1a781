// Bounding spheres of points and of spheres, with the margins that make selection's 32-bit
// arithmetic monotone.
#pragma once

#include <span>

#include "umbel/types.hpp"

namespace umbel::lod {

// Selection compares error > threshold * distance for a group and for the groups that generated
// it, and the answers must agree for every eye. In exact arithmetic nested spheres and ordered
// errors suffice. In 32-bit floats the distance |c - e| carries a relative error below 4e-7:
// - eye nearer than about 100 radii: the sphere's margin (1e-4 of its radius) exceeds the
//   rounding of |c - e|, so the outer sphere still is the nearer one;
// - eye farther: rounding changes distance by less than 4.1e-7 of itself, and the margin between
//   the errors (1e-5) exceeds that.
inline constexpr double kSphereMargin = 1e-4;
inline constexpr double kErrorMargin = 1e-5;

/// A small sphere around all points (Ritter 1990, refined); radius 0 for one point.
Sphere bounding_sphere(std::span<const Vec3> points);

/// A small sphere around all spheres, its radius enlarged by kSphereMargin. At least one sphere.
Sphere enclosing_sphere(std::span<const Sphere> spheres);

}  // namespace umbel::lod
