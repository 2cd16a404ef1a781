// The tests by which selection leaves clusters out, in 32-bit floats in exactly this order.
//
// Why a node that is outside hides nothing. Let the node have the sphere (C, R) and a group below
// it (c, r), with R >= (|c - C| + r)(1 + m), m = 1e-4 (hierarchy.cpp), and let u = 2^-24. The
// sum s of four terms comes out with an error of at most 4u A, A the sum of their magnitudes,
// of which a node must be outside by kNodeSlack A = 16u A: if s + 16u A < -R for the node, then for
// the group s' <= s + |c - C| |n| + 4u (A + A') and A' <= A + 2R, so
//     s' < -R + |c - C| |n| - 16u A + 8u A + 8u R + (roundings of the slack's own sum, < 4u (A +
//     R))
//        < -R (1 - 12u) + |c - C| (1 + 1e-5) < -r,   as m is larger than 1e-5 + 12u.
#pragma once

#include <cmath>

#include "lod/select/refine.hpp"
#include "umbel/lod/select.hpp"

namespace umbel::lod {

inline constexpr float kNodeSlack = 0x1p-20f;

UMBEL_HOST_DEVICE inline float side(const Plane& plane, float x, float y, float z) {
  return ((plane.normal.x * x + plane.normal.y * y) + plane.normal.z * z) + plane.offset;
}

UMBEL_HOST_DEVICE inline bool is_outside(const Sphere& sphere, std::span<const Plane> planes) {
  const Vec3& c = sphere.center;
  for (const Plane& plane : planes)
    if (side(plane, c.x, c.y, c.z) < -sphere.radius) return true;
  return false;
}

/// Whether an inner node is outside by so much that all below it are.
UMBEL_HOST_DEVICE inline bool is_node_outside(const Sphere& sphere, std::span<const Plane> planes) {
  const Vec3& c = sphere.center;
  for (const Plane& plane : planes) {
    const Vec3& n = plane.normal;
    const float size = ((std::fabs(n.x * c.x) + std::fabs(n.y * c.y)) + std::fabs(n.z * c.z)) +
                       std::fabs(plane.offset);
    if (side(plane, c.x, c.y, c.z) + kNodeSlack * size < -sphere.radius) return true;
  }
  return false;
}

UMBEL_HOST_DEVICE inline bool is_outside(const Aabb& box, std::span<const Plane> planes) {
  for (const Plane& plane : planes) {
    const Vec3& n = plane.normal;
    if (side(plane, n.x >= 0 ? box.max.x : box.min.x, n.y >= 0 ? box.max.y : box.min.y,
             n.z >= 0 ? box.max.z : box.min.z) < 0)
      return true;
  }
  return false;
}

UMBEL_HOST_DEVICE inline bool faces_away(const ClusterBounds& bounds, const Vec3& eye) {
  const float x = bounds.sphere.center.x - eye.x;
  const float y = bounds.sphere.center.y - eye.y;
  const float z = bounds.sphere.center.z - eye.z;
  const Vec3& a = bounds.cone_axis;
  return (x * a.x + y * a.y) + z * a.z >=
         bounds.cone_cutoff * vector_length(x, y, z) + bounds.sphere.radius;
}

/// Whether a traversal of the hierarchy must descend below this inner node.
UMBEL_HOST_DEVICE inline bool must_descend(const Node& node, const View& view,
                                           std::span<const Plane> planes) {
  if (view.kind != View::Kind::kLevel && !must_refine(node.sphere, node.error, view)) return false;
  return !is_node_outside(node.sphere, planes);
}

/// Of a cluster whose group is not outside.
inline bool is_visible(const Tables& tables, uint32_t cluster, const View& view,
                       const Culling& culling) {
  if (is_outside(tables.clusters[cluster].box, culling.planes)) return false;
  return culling.normal_cones.empty() || !faces_away(culling.normal_cones[cluster], view.eye);
}

/// Throws kInvalidArgument for what no selection can use.
void check(const View& view);
void check(const Tables& tables, const View& view, const Culling& culling);

}  // namespace umbel::lod
