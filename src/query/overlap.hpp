// The triangles that touch a box (exactly), a sphere, or a frustum (by its planes alone). For the
// nodes of any structure: see traverse_leaves.hpp.
#pragma once

#include <algorithm>

#include "query/leaf_store.hpp"
#include "query/traverse_leaves.hpp"
#include "query/triangle_geometry.hpp"

namespace umbel {
namespace overlap {

/// Sorted, each once: a triangle may lie in several leaves.
template <typename Nodes, typename TouchesBox, typename TouchesTriangle>
std::vector<uint32_t> collect(const LeafStore& data, const TouchesBox& touches_box,
                              const TouchesTriangle& touches_triangle) {
  std::vector<uint32_t> found;
  if (data.reference_count == 0) return found;
  constexpr uint32_t kWidth = Nodes::kWidth;
  traverse_leaves(
      Nodes(data),
      [&](const NodeBoxes<kWidth>& boxes, uint32_t* passes) {
        for (uint32_t i = 0; i < kWidth; ++i)
          passes[i] = touches_box(Aabb{{boxes.min_x()[i], boxes.min_y()[i], boxes.min_z()[i]},
                                       {boxes.max_x()[i], boxes.max_y()[i], boxes.max_z()[i]}});
      },
      [&](uint32_t run) {
        data.for_each_triangle(run, [&](const LeafTriangle& t) {
          if (touches_triangle(t)) found.push_back(t.primitive);
        });
      });
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

inline bool meet(const Aabb& a, const Aabb& b) {
  return a.min.x <= b.max.x && a.max.x >= b.min.x && a.min.y <= b.max.y && a.max.y >= b.min.y &&
         a.min.z <= b.max.z && a.max.z >= b.min.z;
}

inline double distance2(const Aabb& box, const Vec3& p) {
  const auto outside = [](double low, double high, double x) {
    return std::max({low - x, x - high, 0.0});
  };
  const double dx = outside(box.min.x, box.max.x, p.x), dy = outside(box.min.y, box.max.y, p.y);
  const double dz = outside(box.min.z, box.max.z, p.z);
  return dx * dx + dy * dy + dz * dz;
}

inline double height(const Plane& plane, double x, double y, double z) {
  return plane.normal.x * x + plane.normal.y * y + plane.normal.z * z + plane.offset;
}

inline bool reaches(const Frustum& frustum, const Aabb& box) {
  return std::all_of(frustum.begin(), frustum.end(), [&](const Plane& plane) {
    const Vec3& n = plane.normal;
    return height(plane, n.x < 0 ? box.min.x : box.max.x, n.y < 0 ? box.min.y : box.max.y,
                  n.z < 0 ? box.min.z : box.max.z) >= 0;
  });
}

inline bool reaches(const Frustum& frustum, const LeafTriangle& t) {
  return std::all_of(frustum.begin(), frustum.end(), [&](const Plane& plane) {
    const auto above = [&](const Vec3& p) { return height(plane, p.x, p.y, p.z) >= 0; };
    return above(t.p0) || above(t.p1) || above(t.p2);
  });
}

}  // namespace overlap

template <typename Nodes>
std::vector<uint32_t> overlaps_of_box(const LeafStore& data, const Aabb& region) {
  const Aabb box = finite_part(region);
  // An empty box touches nothing, even where it would seem to lie across another.
  if (!(box.min.x <= box.max.x && box.min.y <= box.max.y && box.min.z <= box.max.z)) return {};
  return overlap::collect<Nodes>(
      data, [&](const Aabb& node) { return overlap::meet(node, box); },
      [&](const LeafTriangle& t) { return touches_box(box, t.p0, t.p1, t.p2); });
}

template <typename Nodes>
std::vector<uint32_t> overlaps_of_sphere(const LeafStore& data, const Sphere& sphere) {
  if (!(sphere.radius >= 0) || !is_finite(sphere.center)) return {};
  // Triangles' distances are rounded otherwise than boxes'.
  const double limit = double(sphere.radius) * sphere.radius * (1 + 1e-12);
  const double margin = 1e-28 * dot(to_double(sphere.center), to_double(sphere.center));
  return overlap::collect<Nodes>(
      data,
      [&](const Aabb& node) { return overlap::distance2(node, sphere.center) <= limit + margin; },
      [&](const LeafTriangle& t) { return touches_sphere(sphere, t.p0, t.p1, t.p2); });
}

template <typename Nodes>
std::vector<uint32_t> overlaps_of_frustum(const LeafStore& data, const Frustum& frustum) {
  return overlap::collect<Nodes>(
      data, [&](const Aabb& node) { return overlap::reaches(frustum, node); },
      [&](const LeafTriangle& t) { return overlap::reaches(frustum, t); });
}

}  // namespace umbel
