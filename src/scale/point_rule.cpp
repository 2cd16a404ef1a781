#include "scale/point_rule.hpp"

#include <span>

#include "base/math.hpp"
#include "umbel/mesh.hpp"

namespace umbel::scale {
namespace {

void round(std::span<Vec3> points, const PointRule& rule) {
  if (rule.step > 0) snap_to_grid(points, rule.step);
  for (Vec3& p : points) p = without_negative_zero(p);
}

}  // namespace

std::vector<Vec3> points_of(const io::TriangleBlock& block, const PointRule& rule) {
  std::vector<Vec3> points;
  points.reserve(block.positions.size());
  for (const Vec3d& p : block.positions) points.push_back(relative_to(rule.origin, p));
  round(points, rule);
  return points;
}

Vec3 point_of(const Vec3d& world, const PointRule& rule) {
  Vec3 point = relative_to(rule.origin, world);
  round({&point, 1}, rule);
  return point;
}

}  // namespace umbel::scale
