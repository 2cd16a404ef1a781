// How points of the world become the positions that all of a build shares.
#pragma once

#include <vector>

#include "io/source/triangle_source.hpp"
#include "umbel/types.hpp"

namespace umbel::scale {

struct PointRule {
  Vec3d origin{0, 0, 0};
  float step = 0;  ///< positions are rounded to multiples of it, unless it is 0
};

/// The block's positions relative to the origin, rounded, without -0.
std::vector<Vec3> points_of(const io::TriangleBlock& block, const PointRule& rule);

/// One point by the same rule.
Vec3 point_of(const Vec3d& world, const PointRule& rule);

}  // namespace umbel::scale
