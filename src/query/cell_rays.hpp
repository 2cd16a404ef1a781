// What rays through structures that divide space share (kd-trees, grids, interval hierarchies), for
// any instruction set: where a ray passes a plane, its part within the bounds, and the triangles of
// a leaf.
#pragma once

#include "query/ray_queries.hpp"

namespace umbel {

/// Where a ray passes a plane.
struct PlanePass {
  float low, high;
};

static inline PlanePass pass_of(const RayFrame& f, uint32_t axis, float plane) {
  const float t = plane * f.inv[axis];
  return {t + f.near_b[axis], t + f.far_b[axis]};
}

/// The part of a ray within the bounds. NaN, which extreme numbers may lead to, clips nothing.
struct ClippedRay {
  float from, to;
  PlanePass entry;     ///< where the ray comes in
  int32_t entry_axis;  ///< of the face there; 3: there are several; -1: it begins inside
};

static inline bool clip_to_bounds(const LeafStore& tree, const RayFrame& f, float cull,
                                  ClippedRay& ray) {
  ray.from = f.t_min;
  ray.to = cull;
  const Vec3 &least = tree.bounds.min, &most = tree.bounds.max;
  const float low[3] = {least.x, least.y, least.z}, high[3] = {most.x, most.y, most.z};
  float near_high[3];
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const bool flip = f.inv[axis] < 0.0f;
    const PlanePass near = pass_of(f, axis, flip ? high[axis] : low[axis]);
    const PlanePass far = pass_of(f, axis, flip ? low[axis] : high[axis]);
    near_high[axis] = near.high;
    if (near.low > ray.from) ray.from = near.low;
    if (far.high < ray.to) ray.to = far.high;
  }
  ray.entry = {ray.from, f.t_min};
  ray.entry_axis = -1;
  for (int32_t axis = 0; axis < 3; ++axis) {
    if (near_high[axis] < ray.from) continue;
    ray.entry_axis = ray.entry_axis < 0 ? axis : 3;
    if (near_high[axis] > ray.entry.high) ray.entry.high = near_high[axis];
  }
  return ray.from <= ray.to;
}

/// Tests the triangles of a list, eight at a time. leaf(link) ends the traversal by true.
template <typename Leaf>
static inline bool visit_list(const Range& list, const Leaf& leaf) {
  uint32_t first = list.offset;
  for (uint32_t rest = list.count; rest > 0;) {
    const uint32_t count = rest < kMaxLeafTriangles ? rest : kMaxLeafTriangles;
    if (leaf(LeafStore::leaf_link(first, count))) return true;
    first += count;
    rest -= count;
  }
  return false;
}

/// A node that waits on a stack, and the part of the ray in its cell.
struct CellEntry {
  uint32_t node;
  float from, to;
};

/// The intersector of these structures (see ray_queries.hpp) tests triangles alone: a traversal
/// tests planes itself.
template <typename Triangles>
class LeafIntersector {
 public:
  LeafIntersector(const RayFrame& frame, const LeafStore& /*tree*/)
      : frame_(frame), triangles_(frame) {}
  const RayFrame& frame() const { return frame_; }
  uint32_t triangles(const LeafStore& tree, uint32_t link, bool cull_back, float t_max,
                     LeafHits& hits) const {
    return triangles_(tree, link, cull_back, t_max, hits);
  }

 private:
  const RayFrame& frame_;
  Triangles triangles_;
};

/// Goes through a structure's cells (traverse_cells) with the part of the ray in its bounds.
template <typename Tree, typename Triangles, typename Leaf>
static inline bool traverse(const Tree& tree, const LeafIntersector<Triangles>& intersector,
                            const float& cull, const Leaf& leaf) {
  ClippedRay clipped;
  const RayFrame& f = intersector.frame();
  return clip_to_bounds(tree, f, cull, clipped) &&
         traverse_cells<Triangles>(tree, f, clipped, cull, leaf);
}

template <typename Intersector, typename Tree>
constexpr RayKernels structure_kernels{intersect_ray<Intersector, Tree>,
                                       occluded_ray<Intersector, Tree>,
                                       all_hits_ray<Intersector, Tree>};

}  // namespace umbel
