// The point of the surface closest to another: nodes by the distance of their boxes, nearest
// first, in single precision and with a margin; triangles in double precision. Of points at
// exactly the same distance the lowest primitive's is taken, so that the answer depends neither on
// the tree nor on the order of visits. Points of a batch are visited along a Morton curve, each
// with the answer of the one before as a bound. For the nodes of any structure: see
// traverse_leaves.hpp.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/simd/float4.hpp"
#include "query/closest_rules.hpp"
#include "query/leaf_store.hpp"
#include "query/point_order.hpp"
#include "query/traverse_leaves.hpp"

namespace umbel {
namespace closest {

template <typename Nodes>
class Search {
 public:
  Search(const LeafStore& data, const Vec3& point, float max_distance)
      : data_(data),
        nodes_(data),
        point_(point),
        scale_(unit_scale(std::max({largest_coordinate(point), largest_coordinate(data.bounds.min),
                                    largest_coordinate(data.bounds.max)}))),
        scaled_(point * scale_),
        best_{double(max_distance) * max_distance, 0, 0} {
    set_limit();
  }

  /// Something lies within `distance`: no need to look beyond. Slightly wrong values are allowed
  /// for, as coordinates are rounded.
  void bound(double distance) {
    const double scaled = distance * scale_ * (1 + 1e-5) + 2e-6;
    limit_ = std::min(limit_, static_cast<float>(scaled * scaled));
  }

  ClosestPoint run() {
    stack_[size_++] = {0, nodes_.root()};
    while (size_ > 0) {
      const Entry entry = stack_[--size_];
      if (entry.distance2 > limit_) continue;
      if (nodes_.is_leaf(entry.link))
        nodes_.visit_runs(entry.link, [&](uint32_t run) { visit_run(run); });
      else
        visit_node(entry.link);
    }
    return result();
  }

 private:
  static constexpr uint32_t kWidth = Nodes::kWidth, kLanes = kWidth < 4 ? 4 : kWidth;
  using Link = typename Nodes::Link;

  struct Entry {
    float distance2;  ///< scaled
    Link link;
  };

  void set_limit() { limit_ = box_limit(best_.distance2, scale_); }

  void visit_node(Link node) {
    const auto children = nodes_.children(node);
    const float* const planes = children.boxes().planes;
    float distance2[kLanes];
    uint32_t near = 0;
    for (uint32_t i = 0; i < kWidth; i += 4) {
      const auto plane = [&](uint32_t k) { return load4(planes + size_t{k} * kWidth + i); };
      near |=
          box_distances(plane(0), plane(1), plane(2), plane(3), plane(4), plane(5), distance2 + i)
          << i;
    }
    // Where nodes have two children, half of the lanes mean nothing. half of what was computed. The
    // nearest child ends on top.
    near &= (1u << kWidth) - 1;
    const size_t base = size_;
    for (; near != 0; near &= near - 1) {
      const auto child = static_cast<uint32_t>(std::countr_zero(near));
      const Link link = children.link(child);
      if (link == Nodes::kNoLink) continue;
      size_t at = size_++;
      for (; at > base && stack_[at - 1].distance2 < distance2[child]; --at)
        stack_[at] = stack_[at - 1];
      stack_[at] = {distance2[child], link};
    }
  }

  /// Squared distances of four boxes; the bits of those within the limit.
  uint32_t box_distances(Float4 low_x, Float4 high_x, Float4 low_y, Float4 high_y, Float4 low_z,
                         Float4 high_z, float* distance2) const {
    const Float4 scale = splat(scale_), zero = splat(0);
    const auto outside = [&](Float4 low, Float4 high, float p) {
      const Float4 at = splat(p);
      return max4(max4(low * scale - at, at - high * scale), zero);
    };
    const Float4 dx = outside(low_x, high_x, scaled_.x), dy = outside(low_y, high_y, scaled_.y);
    const Float4 dz = outside(low_z, high_z, scaled_.z);
    const Float4 squared = dx * dx + dy * dy + dz * dz;
    store4(distance2, squared);
    return at_most(squared, splat(limit_));
  }

  void visit_run(uint32_t link) {
    const uint32_t n = LeafStore::leaf_size(link);
    float distance2[kMaxLeafTriangles];
    uint32_t near = (1u << n) - 1;
    if (!data_.compact) near &= triangle_distances(link, n, distance2);
    for (; near != 0; near &= near - 1) {
      const auto i = static_cast<uint32_t>(std::countr_zero(near));
      if (!data_.compact && distance2[i] > limit_) continue;
      visit_triangle(data_.triangle(link, i));
    }
  }

  /// Of the boxes around a leaf's triangles, as box_distances. Most triangles need no more.
  uint32_t triangle_distances(uint32_t link, uint32_t n, float* distance2) const {
    const auto* rows = reinterpret_cast<const float*>(data_.leaves.data()) +
                       size_t{LeafStore::first_reference(link)} * data_.reference_words();
    uint32_t near = 0;
    for (uint32_t i = 0; i < n; i += 4) {
      const auto row = [&](uint32_t k) { return load4(rows + size_t{k} * n + i); };
      const auto low = [&](uint32_t k) { return min4(min4(row(k), row(k + 3)), row(k + 6)); };
      const auto high = [&](uint32_t k) { return max4(max4(row(k), row(k + 3)), row(k + 6)); };
      near |= box_distances(low(0), high(0), low(1), high(1), low(2), high(2), distance2 + i) << i;
    }
    return near;
  }

  void visit_triangle(const LeafTriangle& triangle) {
    const TrianglePoint p = closest_on_triangle(point_, triangle.p0, triangle.p1, triangle.p2);
    if (p.distance2 > best_.distance2 ||
        (p.distance2 == best_.distance2 && triangle.primitive >= primitive_))
      return;
    best_ = p;
    primitive_ = triangle.primitive;
    corners_[0] = triangle.p0, corners_[1] = triangle.p1, corners_[2] = triangle.p2;
    const float before = limit_;
    set_limit();
    limit_ = std::min(limit_, before);
  }

  ClosestPoint result() const {
    if (primitive_ == kNone) return {};
    return closest_at(best_, primitive_, corners_[0], corners_[1], corners_[2]);
  }

  const LeafStore& data_;
  Nodes nodes_;
  Vec3 point_;
  float scale_;
  Vec3 scaled_;
  float limit_ = std::numeric_limits<float>::infinity();
  TrianglePoint best_;
  uint32_t primitive_ = kNone;
  Vec3 corners_[3]{};
  Entry stack_[Nodes::kDepth * (kWidth - 1) + 1];
  size_t size_ = 0;
};

template <typename Nodes>
ClosestPoint find(const LeafStore& data, const Vec3& point, float max_distance,
                  const ClosestPoint* neighbour) {
  if (data.reference_count == 0 || !is_finite(point) || !(max_distance >= 0)) return {};
  Search<Nodes> search(data, point, max_distance);
  if (neighbour && neighbour->primitive != kNone)
    search.bound(length(to_double(neighbour->point) - to_double(point)));
  return search.run();
}

}  // namespace closest

template <typename Nodes>
ClosestPoint closest_point_of(const LeafStore& data, const Vec3& point, float max_distance) {
  return closest::find<Nodes>(data, point, max_distance, nullptr);
}

template <typename Nodes>
void closest_points_of(const LeafStore& data, std::span<const Vec3> points,
                       std::span<ClosestPoint> results, float max_distance) {
  for_points_in_order<ClosestPoint>(points, [&](size_t i, ClosestPoint& last) {
    results[i] = closest::find<Nodes>(data, points[i], max_distance, &last);
    last = results[i];
  });
}

}  // namespace umbel
