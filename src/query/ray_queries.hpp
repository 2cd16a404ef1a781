// The ray queries, over any structure with a function
//   traverse(tree, intersector, cull, leaf)  visits leaves roughly from near to far; leaf(link) may
//                                            lower cull, and ends the traversal by true
// and for any instruction set. `Intersector`, made of a ray's frame and the tree, has
//   triangles(tree, link, cull_back, t_max, hits)  which triangles of a leaf the ray meets in
//                                                  [t_min, t_max]
#pragma once

#include <algorithm>
#include <bit>

#include "query/nearest_hits.hpp"
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

static inline const uint32_t* leaf_words(const LeafStore& tree, uint32_t link) {
  return tree.leaves.data() + size_t{LeafStore::first_reference(link)} * tree.reference_words();
}

/// Keeps the lanes whose triangle the ray's mask sees.
static inline uint32_t visible(const LeafStore& tree, uint32_t link, uint32_t lanes,
                               uint32_t mask) {
  if (!tree.masked) return mask == 0 ? 0 : lanes;
  const uint32_t n = LeafStore::leaf_size(link);
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

/// Flattened: in files with many such traversals a compiler leaves calls, which cost time.
template <typename Intersector, typename Tree>
[[gnu::flatten]] static Hit intersect_ray(const LeafStore& store, const Ray& ray,
                                          const RayOptions& options) {
  const auto& tree = static_cast<const Tree&>(store);
  RayFrame frame;
  if (!make_frame(tree, ray, frame)) return {};
  Hit best;
  float t_max = frame.t_max, cull = t_max, determinant = 1;
  const Intersector tester(frame, tree);
  traverse(tree, tester, cull, [&](uint32_t link) {
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

template <typename Intersector, typename Tree>
[[gnu::flatten]] static bool occluded_ray(const LeafStore& store, const Ray& ray,
                                          const RayOptions& options) {
  const auto& tree = static_cast<const Tree&>(store);
  RayFrame frame;
  if (!make_frame(tree, ray, frame)) return false;
  const Intersector tester(frame, tree);
  return traverse(tree, tester, frame.t_max, [&](uint32_t link) {
    LeafHits hits;
    uint32_t lanes = tester.triangles(tree, link, options.cull_back_faces, frame.t_max, hits);
    if (lanes == 0) return false;
    return visible(tree, link, lanes, options.mask) != 0;
  });
}

/// Hits of a ray that are put in where they belong one by one; more are sorted together.
constexpr size_t kMostInserted = 64;

template <typename Intersector, typename Tree>
static size_t all_hits_ray(const LeafStore& store, const Ray& ray, std::span<Hit> found,
                           const RayOptions& options) {
  const auto& tree = static_cast<const Tree&>(store);
  RayFrame frame;
  if (found.empty() || !make_frame(tree, ray, frame)) return 0;
  // A lambda, so that what std::lower_bound becomes is this file's own.
  const auto before = [](const Hit& a, const Hit& b) { return precedes(a, b); };
  size_t count = 0;
  NearestHits many(found.size());
  bool is_many = false;
  float t_max = frame.t_max;
  const Intersector tester(frame, tree);
  traverse(tree, tester, t_max, [&](uint32_t link) {
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
      if (is_many) {
        many.add({&hit, 1}, t_max);
        continue;
      }
      const auto end = found.begin() + static_cast<std::ptrdiff_t>(count);
      const auto at = std::lower_bound(found.begin(), end, hit, before);
      // Spatial splits put a triangle into several leaves.
      if (at != end && !precedes(hit, *at)) continue;
      if (count < found.size()) {
        std::move_backward(at, end, end + 1);
        ++count;
      } else {
        if (at == end) continue;
        std::move_backward(at, end - 1, end);
      }
      *at = hit;
      if (count == found.size()) {
        t_max = std::min(t_max, found.back().t);
      } else if (count == kMostInserted) {
        many.add(found.first(count), t_max);
        is_many = true;
      }
    }
    return false;
  });
  if (is_many) count = many.write(found);
  for (size_t i = 0; i < count; ++i) found[i].t *= frame.t_unit;
  return count;
}

}  // namespace umbel
