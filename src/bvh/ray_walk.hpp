// The walk through a wide tree, for any instruction set. `Lanes` says how boxes and triangles are
// tested:
//   kWidth                                   slots a node
//   boxes(node, frame, cull, near)           mask of the slots whose box the ray meets in
//                                            [t_min, cull], and where it enters them
//   triangles(tree, link, frame, options, cull, hits)  mask of the triangles that the ray's line
//                                            meets, with t, u, v
// Children are visited from near to far; those further than the nearest hit are skipped.
#pragma once

#include <algorithm>
#include <memory>

#include "bvh/ray_kernels.hpp"
#include "bvh/triangle_test.hpp"

namespace umbel {

struct LeafHits {
  float t[kMaxLeafTriangles], u[kMaxLeafTriangles], v[kMaxLeafTriangles];
};

struct StackEntry {
  float near;
  uint32_t link;
};

/// Room for what a walk may have to come back to; on the heap only for trees of absurd depth.
template <uint32_t width>
class WalkStack {
 public:
  explicit WalkStack(const TriangleBvhData& tree) {
    // A node leaves at most width - 1 siblings behind, and is written whole.
    const size_t need = size_t{tree.max_depth} * (width - 1) + 2 * size_t{width};
    if (need <= kSmall) return;
    large_ = std::make_unique_for_overwrite<StackEntry[]>(need);
    base_ = large_.get();
  }
  StackEntry* base() { return base_; }

 private:
  static constexpr size_t kSmall = 512;
  StackEntry small_[kSmall];
  std::unique_ptr<StackEntry[]> large_;
  StackEntry* base_ = small_;
};

inline const uint32_t* leaf_words(const TriangleBvhData& tree, uint32_t link) {
  return tree.leaves.data() +
         size_t{TriangleBvhData::first_reference(link)} * tree.reference_words();
}

/// Keeps the lanes whose triangle the ray's mask sees.
inline uint32_t visible(const TriangleBvhData& tree, uint32_t link, uint32_t lanes, uint32_t mask) {
  if (!tree.masked) return mask == 0 ? 0 : lanes;
  const uint32_t n = TriangleBvhData::leaf_size(link);
  const uint32_t* masks = leaf_words(tree, link) + size_t{tree.corner_words() + 1} * n;
  for (uint32_t rest = lanes; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<uint32_t>(std::countr_zero(rest));
    if ((masks[lane] & mask) == 0) lanes &= ~(1u << lane);
  }
  return lanes;
}

/// Visits leaves from near to far. leaf(link, cull) may lower cull, and ends the walk by true.
template <typename Lanes, typename Leaf>
bool walk(const TriangleBvhData& tree, const RayFrame& frame, float& cull, const Leaf& leaf) {
  constexpr uint32_t kWidth = Lanes::kWidth;
  WalkStack<kWidth> room(tree);
  StackEntry* const base = room.base();
  StackEntry* top = base;
  uint32_t link = 0;
  while (true) {
    if (TriangleBvhData::is_leaf(link)) {
      if (leaf(link)) return true;
    } else {
      const uint32_t* node = tree.nodes.data() + size_t{link} * (7 * kWidth);
      float near[kWidth];
      StackEntry* const first = top;
      for (uint32_t rest = Lanes::boxes(node, frame, cull, near); rest != 0; rest &= rest - 1) {
        const auto slot = static_cast<uint32_t>(std::countr_zero(rest));
        StackEntry* place = top++;
        for (; place != first && place[-1].near < near[slot]; --place) *place = place[-1];
        *place = {near[slot], node[6 * kWidth + slot]};
      }
    }
    do {
      if (top == base) return false;
      --top;
    } while (top->near > cull);
    link = top->link;
  }
}

template <typename Lanes>
Hit intersect_ray(const TriangleBvhData& tree, const Ray& ray, const RayOptions& options) {
  Hit best;
  RayFrame frame;
  if (!make_frame(tree, ray, frame)) return best;
  float t_max = frame.t_max, cull = cull_distance(t_max);
  walk<Lanes>(tree, frame, cull, [&](uint32_t link) {
    LeafHits hits;
    uint32_t lanes = Lanes::triangles(tree, link, frame, options, t_max, hits);
    if (lanes == 0) return false;
    lanes = visible(tree, link, lanes, options.mask);
    const uint32_t* primitives =
        leaf_words(tree, link) + size_t{tree.corner_words()} * TriangleBvhData::leaf_size(link);
    for (; lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<uint32_t>(std::countr_zero(lanes));
      const float t = hits.t[lane];
      if (t > t_max || (t == t_max && best.hit() && primitives[lane] >= best.primitive)) continue;
      t_max = t;
      best = {t, primitives[lane], hits.u[lane], hits.v[lane]};
    }
    cull = cull_distance(t_max);
    return false;
  });
  if (best.hit()) best.t *= frame.t_unit;
  return best;
}

template <typename Lanes>
bool occluded_ray(const TriangleBvhData& tree, const Ray& ray, const RayOptions& options) {
  RayFrame frame;
  if (!make_frame(tree, ray, frame)) return false;
  float cull = cull_distance(frame.t_max);
  return walk<Lanes>(tree, frame, cull, [&](uint32_t link) {
    LeafHits hits;
    const uint32_t lanes = Lanes::triangles(tree, link, frame, options, frame.t_max, hits);
    return lanes != 0 && visible(tree, link, lanes, options.mask) != 0;
  });
}

template <typename Lanes>
size_t all_hits_ray(const TriangleBvhData& tree, const Ray& ray, std::span<Hit> found,
                    const RayOptions& options) {
  RayFrame frame;
  if (found.empty() || !make_frame(tree, ray, frame)) return 0;
  const auto precedes = [](const Hit& a, const Hit& b) {
    return a.t != b.t ? a.t < b.t : a.primitive < b.primitive;
  };
  size_t count = 0;
  float t_max = frame.t_max, cull = cull_distance(t_max);
  walk<Lanes>(tree, frame, cull, [&](uint32_t link) {
    LeafHits hits;
    uint32_t lanes = Lanes::triangles(tree, link, frame, options, t_max, hits);
    lanes = visible(tree, link, lanes, options.mask);
    const uint32_t* primitives =
        leaf_words(tree, link) + size_t{tree.corner_words()} * TriangleBvhData::leaf_size(link);
    for (; lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<uint32_t>(std::countr_zero(lanes));
      const Hit hit{hits.t[lane], primitives[lane], hits.u[lane], hits.v[lane]};
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
    cull = cull_distance(t_max);
    return false;
  });
  for (size_t i = 0; i < count; ++i) found[i].t *= frame.t_unit;
  return count;
}

template <typename Lanes>
constexpr RayKernels kernels_of{intersect_ray<Lanes>, occluded_ray<Lanes>, all_hits_ray<Lanes>};

}  // namespace umbel
