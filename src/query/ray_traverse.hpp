// The walk through a wide tree, for any instruction set. `Lanes`, made of a ray's frame and the
// tree, says how boxes and triangles are tested:
//   kWidth                           slots a node
//   visit(link, cull, top)           the nearest child of a node whose box the ray meets in
//                                    [t_min, cull], or kNoChild; puts the others on the stack, the
//                                    furthest first
//   triangles(tree, link, cull_back, t_max, hits)  which triangles of a leaf the ray meets in
//                                    [t_min, t_max]
// Children are visited from near to far; those further than the nearest hit are skipped.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>

#include "query/ray_kernels.hpp"
#include "query/triangle_test.hpp"

namespace umbel {

/// Of the triangles that are hit: t, and the barycentric coordinates times the determinant.
struct LeafHits {
  alignas(32) float t[kMaxLeafTriangles];
  alignas(32) float v[kMaxLeafTriangles];
  alignas(32) float w[kMaxLeafTriangles];
  alignas(32) float determinant[kMaxLeafTriangles];
};

/// Where a box is entered is in the upper half, so that entries compare as integers where t >= 0.
struct StackEntry {
  uint32_t link;
  float near;
};

/// Room for what a walk may have to come back to; on the heap only for trees of absurd depth.
template <typename Lanes>
class WalkStack {
 public:
  explicit WalkStack(const TriangleBvhData& tree) {
    // A node leaves at most width - 1 siblings behind; eight are written at once.
    const size_t need = size_t{tree.max_depth} * (Lanes::kWidth - 1) + 16;
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

static inline const uint32_t* leaf_words(const LeafStore& tree, uint32_t link) {
  return tree.leaves.data() +
         size_t{TriangleBvhData::first_reference(link)} * tree.reference_words();
}

/// Keeps the lanes whose triangle the ray's mask sees.
static inline uint32_t visible(const LeafStore& tree, uint32_t link, uint32_t lanes,
                               uint32_t mask) {
  if (!tree.masked) return mask == 0 ? 0 : lanes;
  const uint32_t n = TriangleBvhData::leaf_size(link);
  const uint32_t* masks = leaf_words(tree, link) + size_t{tree.corner_words() + 1} * n;
  for (uint32_t rest = lanes; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<uint32_t>(std::countr_zero(rest));
    if ((masks[lane] & mask) == 0) lanes &= ~(1u << lane);
  }
  return lanes;
}

static inline Hit hit_of(const LeafHits& hits, uint32_t lane, float t, uint32_t primitive) {
  return {t, primitive, hits.v[lane] / hits.determinant[lane],
          hits.w[lane] / hits.determinant[lane]};
}

/// Pushes the slots of a mask, the furthest first, and takes the nearest off again.
template <uint32_t width>
static inline uint32_t push_sorted(const uint32_t* links, uint32_t slots, const float* near,
                                   StackEntry*& top) {
  StackEntry* const first = top;
  for (; slots != 0; slots &= slots - 1) {
    const auto slot = static_cast<uint32_t>(std::countr_zero(slots));
    StackEntry* place = top++;
    for (; place != first && place[-1].near < near[slot]; --place) *place = place[-1];
    *place = {links[slot], near[slot]};
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
    uint32_t slots = 0;
    for (uint32_t i = 0; i < width; ++i) slots |= static_cast<uint32_t>(near[i] <= far[i]) << i;
    return slots == 0 ? kNoChild : push_sorted<width>(node + 6 * width, slots, near, top);
  }

 private:
  const RayFrame& f_;
  float t_min_;
};

/// Moves b for nodes on grids. There t of plane q is q (cell inv) + (origin inv + b), which is off
/// by up to 8 u E |inv| rather than 4 (see ray_frame.hpp). One more may be lost where a plane is
/// rounded to what it is compared with, and one where b is moved: 6 + 6 + 8 + 1 + 1 < 16 + 8.
static inline void widen_slack(const RayFrame& f, Quad& near_b, Quad& far_b) {
  std::memcpy(&near_b, f.near_b, sizeof near_b);
  std::memcpy(&far_b, f.far_b, sizeof far_b);
  const Quad more = (far_b - near_b) * 0.25f;
  near_b -= more;
  far_b += more;
}

template <uint32_t width>
static inline uint32_t children_of(const uint32_t* links) {
  uint32_t slots = 0;
  for (uint32_t i = 0; i < width; ++i) slots |= static_cast<uint32_t>(links[i] != kNoChild) << i;
  return slots;
}

/// PlainBoxes for nodes on grids.
template <typename Tag, uint32_t width>
class GridBoxes {
 public:
  explicit GridBoxes(const RayFrame& frame) : f_(frame), t_min_(frame.t_min) {
    widen_slack(frame, near_b_, far_b_);
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
    uint32_t slots = 0;
    for (uint32_t i = 0; i < width; ++i) slots |= static_cast<uint32_t>(near[i] <= far[i]) << i;
    const uint32_t* const links = node + grid::links_at(width);
    slots &= children_of<width>(links);
    return slots == 0 ? kNoChild : push_sorted<width>(links, slots, near, top);
  }

 private:
  const RayFrame& f_;
  Quad near_b_, far_b_;
  float t_min_;
};

/// What comes after the next is fetched ahead: its first two cache lines, as the others follow by
/// themselves. There is nothing where the stack's first entry points, which does no harm.
static inline void prefetch(const TriangleBvhData& tree, uint32_t link) {
  const uint32_t* const words = TriangleBvhData::is_leaf(link)
                                    ? leaf_words(tree, link)
                                    : tree.nodes.data() + size_t{2} * link;
  __builtin_prefetch(words);
  __builtin_prefetch(words + 16);
}

/// Visits leaves from near to far. leaf(link) may lower cull, and ends the walk by true.
template <typename Lanes, typename Leaf>
static inline bool walk(const TriangleBvhData& tree, const Lanes& lanes, const float& cull,
                        const Leaf& leaf) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  WalkStack<Lanes> room(tree);
  StackEntry* top = room.base();
  *top++ = {kNoChild, -kInfinity};
  uint32_t link = 0;
  while (true) {
    while (!TriangleBvhData::is_leaf(link)) {
      link = lanes.visit(link, cull, top);
      prefetch(tree, top[-1].link);
    }
    if (link != kNoChild && leaf(link)) return true;
    do {
      link = (--top)->link;
    } while (top->near > cull);
    // The stack's first entry, which no distance skips.
    if (link == kNoChild) return false;
  }
}

// The queries, over any structure with a `walk` such as the one above.

/// All that it calls becomes part of it: as calls, which a compiler prefers in files with many such
/// walks, they took 3 % of the time.
template <typename Lanes, typename Tree>
[[gnu::flatten]] static Hit intersect_ray(const LeafStore& store, const Ray& ray,
                                          const RayOptions& options) {
  const auto& tree = static_cast<const Tree&>(store);
  RayFrame frame;
  if (!make_frame(tree, ray, frame)) return {};
  Hit best;
  float t_max = frame.t_max, cull = t_max, determinant = 1;
  const Lanes tester(frame, tree);
  walk(tree, tester, cull, [&](uint32_t link) {
    LeafHits hits;
    uint32_t lanes = tester.triangles(tree, link, options.cull_back_faces, t_max, hits);
    if (lanes == 0) return false;
    lanes = visible(tree, link, lanes, options.mask);
    const uint32_t* primitives =
        leaf_words(tree, link) + size_t{tree.corner_words()} * LeafStore::leaf_size(link);
    for (; lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<uint32_t>(std::countr_zero(lanes));
      const float t = hits.t[lane];
      if (t > t_max || (t == t_max && best.hit() && primitives[lane] >= best.primitive)) continue;
      t_max = t;
      best = {t, primitives[lane], hits.v[lane], hits.w[lane]};
      determinant = hits.determinant[lane];
    }
    cull = t_max;
    return false;
  });
  if (best.hit())
    best = {best.t * frame.t_unit, best.primitive, best.u / determinant, best.v / determinant};
  return best;
}

template <typename Lanes, typename Tree>
[[gnu::flatten]] static bool occluded_ray(const LeafStore& store, const Ray& ray,
                                          const RayOptions& options) {
  const auto& tree = static_cast<const Tree&>(store);
  RayFrame frame;
  if (!make_frame(tree, ray, frame)) return false;
  const Lanes tester(frame, tree);
  return walk(tree, tester, frame.t_max, [&](uint32_t link) {
    LeafHits hits;
    uint32_t lanes = tester.triangles(tree, link, options.cull_back_faces, frame.t_max, hits);
    if (lanes == 0) return false;
    return visible(tree, link, lanes, options.mask) != 0;
  });
}

template <typename Lanes, typename Tree>
static size_t all_hits_ray(const LeafStore& store, const Ray& ray, std::span<Hit> found,
                           const RayOptions& options) {
  const auto& tree = static_cast<const Tree&>(store);
  RayFrame frame;
  if (found.empty() || !make_frame(tree, ray, frame)) return 0;
  const auto precedes = [](const Hit& a, const Hit& b) {
    return a.t != b.t ? a.t < b.t : a.primitive < b.primitive;
  };
  size_t count = 0;
  float t_max = frame.t_max;
  const Lanes tester(frame, tree);
  walk(tree, tester, t_max, [&](uint32_t link) {
    LeafHits hits;
    uint32_t lanes = tester.triangles(tree, link, options.cull_back_faces, t_max, hits);
    lanes = visible(tree, link, lanes, options.mask);
    const uint32_t* primitives =
        leaf_words(tree, link) + size_t{tree.corner_words()} * LeafStore::leaf_size(link);
    for (; lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<uint32_t>(std::countr_zero(lanes));
      const float t = hits.t[lane];
      if (t > t_max) continue;
      const Hit hit = hit_of(hits, lane, t, primitives[lane]);
      const auto end = found.begin() + static_cast<std::ptrdiff_t>(count);
      const auto place = std::lower_bound(found.begin(), end, hit, precedes);
      // Spatial splits put a triangle into several leaves.
      if (place != end && place->t == hit.t && place->primitive == hit.primitive) continue;
      if (count < found.size()) {
        std::move_backward(place, end, end + 1);
        ++count;
      } else {
        if (place == end) continue;
        std::move_backward(place, end - 1, end);
      }
      *place = hit;
      if (count == found.size()) t_max = std::min(t_max, found.back().t);
    }
    return false;
  });
  for (size_t i = 0; i < count; ++i) found[i].t *= frame.t_unit;
  return count;
}

template <typename Lanes>
constexpr RayKernels kernels_of{intersect_ray<Lanes, TriangleBvhData>,
                                occluded_ray<Lanes, TriangleBvhData>,
                                all_hits_ray<Lanes, TriangleBvhData>};

}  // namespace umbel
