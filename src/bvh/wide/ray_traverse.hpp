// The traversal of a wide tree by a ray, for any instruction set. `Intersector`
// (query/ray_queries.hpp) also says how boxes are tested:
//   kWidth                           children a node
//   visit(link, cull, top)           the nearest child of a node whose box the ray meets in
//                                    [t_min, cull], or kNoChild; puts the others on the stack, the
//                                    furthest first
// Children are visited from near to far; those further than the nearest hit are skipped.
#pragma once

#include <limits>
#include <memory>

#include "bvh/wide/triangle_bvh_data.hpp"
#include "query/ray_queries.hpp"

namespace umbel {

/// Where a box is entered is in the upper half, so that entries compare as integers where t >= 0.
struct StackEntry {
  uint32_t link;
  float near;
};

/// Memory for what a traversal has to come back to; on the heap only for extremely deep trees.
template <typename Intersector>
class RayStack {
 public:
  explicit RayStack(const BvhData& tree) {
    // A node leaves at most width - 1 siblings behind; eight are written at once.
    const size_t need = size_t{tree.max_depth} * (Intersector::kWidth - 1) + 16;
    if (need > kSmall) [[unlikely]] {
      large_ = std::make_unique_for_overwrite<StackEntry[]>(need);
      base_ = large_.get();
    }
  }
  StackEntry* base() { return base_; }

 private:
  static constexpr size_t kSmall = 512;
  StackEntry small_[kSmall];
  std::unique_ptr<StackEntry[]> large_;
  StackEntry* base_ = small_;
};

/// Pushes the children of a mask, the furthest first, but returns the nearest, or kNoChild for an
/// empty mask.
static inline uint32_t push_but_nearest(const uint32_t* links, uint32_t entered, const float* near,
                                        StackEntry*& top) {
  if (entered == 0) return kNoChild;
  StackEntry* const first = top;
  for (; entered != 0; entered &= entered - 1) {
    const auto child = static_cast<uint32_t>(std::countr_zero(entered));
    StackEntry* at = top++;
    for (; at != first && at[-1].near < near[child]; --at) *at = at[-1];
    *at = {links[child], near[child]};
  }
  return (--top)->link;
}

/// The box test in plain C++. `Tag` keeps the instruction sets' forms apart.
template <typename Tag, uint32_t width>
class PlainBoxes {
 public:
  explicit PlainBoxes(const RayFrame& frame) : f_(frame), t_min_(frame.t_min) {}

  uint32_t visit(const uint32_t* node, float cull, StackEntry*& top) const {
    float near[width], far[width];
    for (uint32_t i = 0; i < width; ++i) {
      near[i] = t_min_;
      far[i] = cull;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const uint32_t* low = node + static_cast<size_t>(2 * axis) * width;
      const bool flip = f_.inv[axis] < 0.0f;
      const uint32_t *near_planes = low + (flip ? width : 0),
                     *far_planes = low + (flip ? 0 : width);
      for (uint32_t i = 0; i < width; ++i) {
        const float a = std::bit_cast<float>(near_planes[i]) * f_.inv[axis] + f_.near_b[axis];
        const float b = std::bit_cast<float>(far_planes[i]) * f_.inv[axis] + f_.far_b[axis];
        near[i] = a > near[i] ? a : near[i];
        far[i] = b < far[i] ? b : far[i];
      }
    }
    uint32_t entered = 0;
    for (uint32_t i = 0; i < width; ++i) entered |= static_cast<uint32_t>(near[i] <= far[i]) << i;
    return push_but_nearest(node + 6 * width, entered, near, top);
  }

 private:
  const RayFrame& f_;
  float t_min_;
};

/// Moves b for nodes on grids. There t of plane q is q (cell inv) + (origin inv + b), which is off
/// by up to 8 u E |inv| rather than 4 (see ray_frame.hpp). One more may be lost where a plane is
/// rounded to what it is compared with, and one where b is moved: 6 + 6 + 8 + 1 + 1 < 16 + 8.
static inline void widen_error_bounds(const RayFrame& f, Float4& near_b, Float4& far_b) {
  std::memcpy(&near_b, f.near_b, sizeof near_b);
  std::memcpy(&far_b, f.far_b, sizeof far_b);
  Float4 error;
  std::memcpy(&error, f.error, sizeof error);
  const Float4 more = error * 0.5f;
  near_b -= more;
  far_b += more;
}

template <uint32_t width>
static inline uint32_t children_of(const uint32_t* links) {
  uint32_t children = 0;
  for (uint32_t i = 0; i < width; ++i) children |= static_cast<uint32_t>(links[i] != kNoChild) << i;
  return children;
}

/// PlainBoxes for nodes on grids.
template <typename Tag, uint32_t width>
class GridBoxes {
 public:
  explicit GridBoxes(const RayFrame& frame) : f_(frame), t_min_(frame.t_min) {
    widen_error_bounds(frame, near_b_, far_b_);
  }

  uint32_t visit(const uint32_t* node, float cull, StackEntry*& top) const {
    float near[width], far[width];
    for (uint32_t i = 0; i < width; ++i) {
      near[i] = t_min_;
      far[i] = cull;
    }
    const auto* const rows = reinterpret_cast<const unsigned char*>(node + grid::kFirstRow);
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const float origin = std::bit_cast<float>(node[axis]) * f_.inv[axis];
      const float cell = std::bit_cast<float>(node[3 + axis]) * f_.inv[axis];
      const float near_b = origin + near_b_[axis], far_b = origin + far_b_[axis];
      const uint32_t flip = f_.inv[axis] < 0.0f ? 1 : 0;
      grid::GridPlane near_planes[width], far_planes[width];
      std::memcpy(near_planes, rows + (2 * axis + flip) * sizeof near_planes, sizeof near_planes);
      std::memcpy(far_planes, rows + (2 * axis + 1 - flip) * sizeof far_planes, sizeof far_planes);
      for (uint32_t i = 0; i < width; ++i) {
        const float a = static_cast<float>(near_planes[i]) * cell + near_b;
        const float b = static_cast<float>(far_planes[i]) * cell + far_b;
        near[i] = a > near[i] ? a : near[i];
        far[i] = b < far[i] ? b : far[i];
      }
    }
    uint32_t entered = 0;
    for (uint32_t i = 0; i < width; ++i) entered |= static_cast<uint32_t>(near[i] <= far[i]) << i;
    const uint32_t* const links = node + grid::links_at(width);
    entered &= children_of<width>(links);
    return push_but_nearest(links, entered, near, top);
  }

 private:
  const RayFrame& f_;
  Float4 near_b_, far_b_;
  float t_min_;
};

/// Visits leaves from near to far. leaf(link) may lower cull, and ends the traversal by true.
template <typename Intersector, typename Leaf>
static inline bool traverse(const BvhData& tree, const Intersector& intersector, const float& cull,
                            const Leaf& leaf) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  RayStack<Intersector> room(tree);
  StackEntry* top = room.base();
  *top++ = {kNoChild, -kInfinity};
  uint32_t link = 0;
  while (true) {
    while (!BvhData::is_leaf(link)) link = intersector.visit(link, cull, top);
    if (link != kNoChild && leaf(link)) return true;
    do {
      link = (--top)->link;
    } while (top->near > cull);
    // The stack's first entry, which no distance skips.
    if (link == kNoChild) return false;
  }
}

template <typename Intersector>
constexpr RayKernels kernels_of{intersect_ray<Intersector, BvhData>,
                                occluded_ray<Intersector, BvhData>,
                                all_hits_ray<Intersector, BvhData>};

}  // namespace umbel
