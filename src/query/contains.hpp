// Whether points lie inside a closed mesh: the parity of the triangles that a ray along an axis
// crosses. The ray is perturbed by an infinitely small amount (Edelsbrunner & Muecke,
// "Simulation of Simplicity", 1990) and every decision is an exact sign, so a ray through a
// vertex or along an edge crosses exactly the triangles that its neighbour crosses, and boxes are
// compared without rounding at all. For the nodes of any structure: see traverse_leaves.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "query/leaf_store.hpp"
#include "query/orientation.hpp"
#include "query/point_order.hpp"
#include "query/traverse_leaves.hpp"

namespace umbel {
namespace inside {

using orientation::Point2;

/// Which side of a -> b the point p lies on once it is moved by (e, e^2) for an infinitely small
/// e; 0 only where a equals b.
inline int perturbed_side(const Point2& a, const Point2& b, const Point2& p) {
  if (const int side = orientation::orient2d(a, b, p)) return side;
  if (a.y != b.y) return a.y > b.y ? 1 : -1;
  return (b.x > a.x) - (b.x < a.x);
}

/// The axis of a ray and the two others in cyclic order, and the way it goes.
template <int kAxis, bool kUp>
struct AxisRay {
  static float along(const Vec3& p) { return kAxis == 0 ? p.x : kAxis == 1 ? p.y : p.z; }
  static Point2 across(const Vec3& p) {
    return kAxis == 0 ? Point2{p.y, p.z} : kAxis == 1 ? Point2{p.z, p.x} : Point2{p.x, p.y};
  }

  static bool crosses(const Vec3& p, const LeafTriangle& t) {
    const float far = kUp ? std::max({along(t.p0), along(t.p1), along(t.p2)})
                          : std::min({along(t.p0), along(t.p1), along(t.p2)});
    if (kUp ? far < along(p) : far > along(p)) return false;
    const Point2 q = across(p), a = across(t.p0), b = across(t.p1), c = across(t.p2);
    const int turn = perturbed_side(a, b, q);
    if (turn == 0 || perturbed_side(b, c, q) != turn || perturbed_side(c, a, q) != turn)
      return false;
    // In cyclic order a triangle that turns counter-clockwise looks up; a point below its plane
    // has the plane above it. The axes' order is even, so the 3D sign needs no correction.
    const int below = turn * orientation::orient3d(t.p0, t.p1, t.p2, p);
    return kUp ? below > 0 : below < 0;
  }

  /// Whether the ray, or one beside it, meets a box.
  template <uint32_t kWidth>
  static void test(const Vec3& p, const NodeBoxes<kWidth>& boxes, uint32_t* passes) {
    const float* low[3] = {boxes.min_x(), boxes.min_y(), boxes.min_z()};
    const float* high[3] = {boxes.max_x(), boxes.max_y(), boxes.max_z()};
    const float q[3] = {p.x, p.y, p.z};
    constexpr int kNext = (kAxis + 1) % 3, kLast = (kAxis + 2) % 3;
    for (uint32_t i = 0; i < kWidth; ++i) {
      const uint32_t ahead = kUp ? high[kAxis][i] >= q[kAxis] : low[kAxis][i] <= q[kAxis];
      passes[i] = ahead & uint32_t{low[kNext][i] <= q[kNext]} &
                  uint32_t{high[kNext][i] >= q[kNext]} & uint32_t{low[kLast][i] <= q[kLast]} &
                  uint32_t{high[kLast][i] >= q[kLast]};
    }
  }
};

/// Triangles that were crossed. One that lies in several leaves is met more than once.
class Crossings {
 public:
  explicit Crossings(bool repeats) : repeats_(repeats) {}
  void add(uint32_t primitive) {
    ++count_;
    if (repeats_) met_.push_back(primitive);
  }
  bool is_odd() {
    if (!repeats_) return (count_ & 1) != 0;
    std::sort(met_.begin(), met_.end());
    return (std::unique(met_.begin(), met_.end()) - met_.begin()) % 2 != 0;
  }

 private:
  bool repeats_;
  size_t count_ = 0;
  std::vector<uint32_t> met_;
};

template <typename Nodes, typename Ray>
bool crosses_odd(const LeafStore& data, const Vec3& p) {
  const Nodes nodes(data);
  Crossings crossings(nodes.repeats());
  traverse_leaves(
      nodes,
      [&](const NodeBoxes<Nodes::kWidth>& boxes, uint32_t* passes) { Ray::test(p, boxes, passes); },
      [&](uint32_t link) {
        data.for_each_triangle(link, [&](const LeafTriangle& triangle) {
          if (Ray::crosses(p, triangle)) crossings.add(triangle.primitive);
        });
      });
  return crossings.is_odd();
}

/// Of the six sides of the bounds the one that a ray reaches soonest, in parts of the extent: it
/// meets the fewest boxes.
inline int nearest_side(const Aabb& b, const Vec3& p) {
  const auto share = [](float way, float low, float high) {
    return way / std::max(high - low, std::numeric_limits<float>::min());
  };
  const float ways[6] = {
      share(p.x - b.min.x, b.min.x, b.max.x), share(b.max.x - p.x, b.min.x, b.max.x),
      share(p.y - b.min.y, b.min.y, b.max.y), share(b.max.y - p.y, b.min.y, b.max.y),
      share(p.z - b.min.z, b.min.z, b.max.z), share(b.max.z - p.z, b.min.z, b.max.z)};
  return static_cast<int>(std::min_element(ways, ways + 6) - ways);
}

inline bool in_box(const Aabb& b, const Vec3& p) {
  return p.x >= b.min.x && p.x <= b.max.x && p.y >= b.min.y && p.y <= b.max.y && p.z >= b.min.z &&
         p.z <= b.max.z;
}

template <typename Nodes>
bool is_inside(const LeafStore& data, const Vec3& p) {
  if (data.reference_count == 0 || !in_box(data.bounds, p)) return false;
  switch (nearest_side(data.bounds, p)) {
    case 0:
      return crosses_odd<Nodes, AxisRay<0, false>>(data, p);
    case 1:
      return crosses_odd<Nodes, AxisRay<0, true>>(data, p);
    case 2:
      return crosses_odd<Nodes, AxisRay<1, false>>(data, p);
    case 3:
      return crosses_odd<Nodes, AxisRay<1, true>>(data, p);
    case 4:
      return crosses_odd<Nodes, AxisRay<2, false>>(data, p);
    default:
      return crosses_odd<Nodes, AxisRay<2, true>>(data, p);
  }
}

struct Nothing {};

}  // namespace inside

template <typename Nodes>
bool contains_of(const LeafStore& data, const Vec3& point) {
  return inside::is_inside<Nodes>(data, point);
}

template <typename Nodes>
void contains_all_of(const LeafStore& data, std::span<const Vec3> points,
                     std::span<uint8_t> results) {
  for_points_in_order<inside::Nothing>(points, [&](size_t i, inside::Nothing&) {
    results[i] = inside::is_inside<Nodes>(data, points[i]) ? 1 : 0;
  });
}

}  // namespace umbel
