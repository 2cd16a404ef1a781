// Traversals of a kdtree::Tree over primitives of your own: templates that take the visit of a leaf
// as a function, which is inlined.
//
// A ray against spheres, nearest first:
//
//   const kdtree::Tree tree = kdtree::build(boxes_of(spheres));
//   float nearest = ray.t_max;
//   kdtree::traverse(tree, ray, [&](std::span<const uint32_t> primitives) {
//     for (uint32_t i : primitives) nearest = std::min(nearest, hit(ray, spheres[i]));
//     return nearest;  // cells that begin farther away are left out
//   });
//
// A primitive may lie in several leaves, and so be visited more than once.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "umbel/kdtree.hpp"

namespace umbel::kdtree {

/// Deepest leaf that there may be.
inline constexpr uint32_t kMaxDepth = 64;

namespace detail {

/// Whether a ray can meet anything.
inline bool is_sound(const Ray& ray) {
  const auto is_finite = [](const Vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  };
  const Vec3& d = ray.direction;
  return ray.t_min <= ray.t_max && !(d.x == 0 && d.y == 0 && d.z == 0) && is_finite(ray.origin) &&
         is_finite(d);
}

/// Part of a ray; empty where from > to.
struct RayPart {
  double from, to;
};

/// Where a ray passes planes. Cells are taken as larger by 2^-22 of their coordinates and of the
/// origin's, far more than rounding moves anything.
class RayPlanes {
 public:
  explicit RayPlanes(const Ray& ray)
      : origin_{ray.origin.x, ray.origin.y, ray.origin.z},
        direction_{ray.direction.x, ray.direction.y, ray.direction.z} {}

  /// Whether a part of the ray below the plane comes before that above it.
  bool goes_up(uint32_t axis) const { return direction_[axis] >= 0; }

  /// The parts on the near and the far side of a plane.
  void split(uint32_t axis, double at, const RayPart& part, RayPart& near, RayPart& far) const {
    near = far = part;
    const double offset = at - origin_[axis];
    const double slack = (std::fabs(at) + std::fabs(origin_[axis])) * 0x1p-22;
    const double direction = direction_[axis];
    if (direction == 0) {  // below is the near side
      if (offset < -slack) near.to = -1, near.from = 0;
      if (offset > slack) far.to = -1, far.from = 0;
      return;
    }
    const double t = offset / direction, error = slack / std::fabs(direction);
    near.to = std::min(near.to, t + error);
    far.from = std::max(far.from, t - error);
  }

  /// The part within a box.
  RayPart within(const Aabb& box, RayPart part) const {
    const float low[3] = {box.min.x, box.min.y, box.min.z};
    const float high[3] = {box.max.x, box.max.y, box.max.z};
    for (uint32_t axis = 0; axis < 3; ++axis) {
      RayPart outside, inside;
      split(axis, goes_up(axis) ? low[axis] : high[axis], part, outside, inside);
      split(axis, goes_up(axis) ? high[axis] : low[axis], inside, part, outside);
    }
    return part;
  }

 private:
  double origin_[3], direction_[3];
};

inline std::span<const uint32_t> references_of(const Tree& tree, const Node& leaf) {
  return {tree.references.data() + leaf.list().offset, leaf.list().count};
}

}  // namespace detail

/// Visits the leaves that a ray passes through, from near to far, but empty ones.
/// `leaf(std::span<const uint32_t> primitives)` returns the limit from then on: cells that the ray
/// enters behind it are not visited, and the limit never rises. One below t_min ends the visit.
/// Returns the last limit, which is t_max at first. A ray with a NaN, a zero direction or an
/// empty interval visits nothing. No recursion and no allocation. The tree must be sound
/// (kdtree::check).
template <typename Leaf>
float traverse(const Tree& tree, const Ray& ray, Leaf&& leaf) {
  struct Entry {
    uint32_t node;
    detail::RayPart part;
  };
  float limit = ray.t_max;
  if (tree.nodes.empty() || !detail::is_sound(ray)) return limit;
  const detail::RayPlanes planes(ray);
  std::array<Entry, kMaxDepth + 1> stack;
  size_t waiting = 0;
  stack[waiting++] = {0, planes.within(tree.bounds, {ray.t_min, ray.t_max})};
  while (waiting > 0) {
    Entry here = stack[--waiting];
    if (here.part.from > here.part.to || here.part.from > limit) continue;
    while (!tree.nodes[here.node].is_leaf()) {
      const Node& node = tree.nodes[here.node];
      const bool up = planes.goes_up(node.axis());
      Entry near{up ? here.node + 1 : node.above(), {}}, far{up ? node.above() : here.node + 1, {}};
      planes.split(node.axis(), node.at, here.part, near.part, far.part);
      if (near.part.from > near.part.to) {
        here = far;
        continue;
      }
      if (far.part.from <= far.part.to) stack[waiting++] = far;
      here = near;
    }
    const auto primitives = detail::references_of(tree, tree.nodes[here.node]);
    if (primitives.empty() || here.part.from > here.part.to) continue;
    limit = std::min(limit, static_cast<float>(leaf(primitives)));
    if (limit < ray.t_min) break;
  }
  return limit;
}

/// Visits the leaves whose cells touch a box, but empty ones. `leaf(primitives) -> bool` says
/// whether to go on. Returns false if it was told to stop. Otherwise as above.
template <typename Leaf>
bool traverse(const Tree& tree, const Aabb& box, Leaf&& leaf) {
  const float low[3] = {box.min.x, box.min.y, box.min.z};
  const float high[3] = {box.max.x, box.max.y, box.max.z};
  if (tree.nodes.empty()) return true;
  std::array<uint32_t, kMaxDepth + 1> stack;
  size_t waiting = 0;
  stack[waiting++] = 0;
  while (waiting > 0) {
    uint32_t here = stack[--waiting];
    bool is_outside = false;
    while (!tree.nodes[here].is_leaf() && !is_outside) {
      const Node& node = tree.nodes[here];
      const bool below = low[node.axis()] <= node.at, above = high[node.axis()] >= node.at;
      if (below && above) stack[waiting++] = node.above();
      is_outside = !below && !above;
      here = below ? here + 1 : node.above();
    }
    if (is_outside) continue;
    const auto primitives = detail::references_of(tree, tree.nodes[here]);
    if (!primitives.empty() && !leaf(primitives)) return false;
  }
  return true;
}

}  // namespace umbel::kdtree
