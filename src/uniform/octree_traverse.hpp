// Rays through an octree, for any instruction set: from near to far, one plane after the other,
// with the bounds of query/cell_rays.hpp for where a plane is passed.
#pragma once

#include "query/cell_rays.hpp"
#include "uniform/octree_data.hpp"

namespace umbel {

template <typename Triangles, typename Leaf>
static inline bool traverse_cells(const OctreeData& tree, const RayFrame& f,
                                  const ClippedRay& clipped, const float& cull, const Leaf& leaf) {
  struct Entry {
    uint32_t node, axis, child;
    float from, to;
  };
  Entry stack[OctreeNodes::kDepth + 1];
  Entry* top = stack;
  const OctreeNode* const nodes = tree.nodes.data();
  const uint32_t flips[3] = {f.inv[0] < 0.0f, f.inv[1] < 0.0f, f.inv[2] < 0.0f};
  Entry here{0, 0, 0, clipped.from, clipped.to};
  while (true) {
    while (here.axis > 0 || !nodes[here.node].is_leaf()) {
      const OctreeNode& n = nodes[here.node];
      const float* const middle = &n.middle.x;
      const PlanePass pass = pass_of(f, here.axis, middle[here.axis]);
      uint32_t near = here.child | flips[here.axis] << here.axis;
      uint32_t far = here.child | (flips[here.axis] ^ 1u) << here.axis;
      const bool is_last = here.axis == 2;
      const uint32_t next_axis = is_last ? 0 : here.axis + 1;
      const uint32_t near_node = is_last ? n.children + near : here.node;
      const uint32_t far_node = is_last ? n.children + far : here.node;
      if (is_last) near = far = 0;
      if (pass.high < here.from) {
        here = {far_node, next_axis, far, here.from, here.to};
      } else if (pass.low > here.to) {
        here = {near_node, next_axis, near, here.from, here.to};
      } else {
        *top++ = {far_node, next_axis, far, pass.low > here.from ? pass.low : here.from, here.to};
        here = {near_node, next_axis, near, here.from, pass.high < here.to ? pass.high : here.to};
      }
    }
    if (visit_list(nodes[here.node].list, leaf)) return true;
    do {
      if (top == stack) return false;
      --top;
    } while (top->from > cull);
    here = *top;
    here.to = here.to < cull ? here.to : cull;
  }
}

template <typename Triangles>
static const RayKernels* octree_kernels() {
  return &structure_kernels<LeafIntersector<Triangles>, OctreeData>;
}

}  // namespace umbel
