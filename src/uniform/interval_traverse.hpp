// Rays through a bounding interval hierarchy, for any instruction set: from near to far, with the
// bounds of query/cell_rays.hpp for where a plane is passed.
#pragma once

#include "query/cell_rays.hpp"
#include "uniform/interval_data.hpp"

namespace umbel {

template <typename Triangles, typename Leaf>
static inline bool traverse_cells(const IntervalData& tree, const RayFrame& f,
                                  const ClippedRay& clipped, const float& cull, const Leaf& leaf) {
  CellEntry stack[kMaxIntervalDepth + 1];
  CellEntry* top = stack;
  const IntervalNode* const nodes = tree.nodes.data();
  uint32_t node = 0;
  float from = clipped.from, to = clipped.to;
  while (true) {
    bool is_between = false;  // the ray passes between the children
    while (!nodes[node].is_leaf()) {
      const IntervalNode& n = nodes[node];
      const uint32_t axis = n.axis(), below = node + 1, above = node + n.above();
      const bool flip = f.inv[axis] < 0.0f;
      const PlanePass below_end = pass_of(f, axis, n.below_max),
                      above_begin = pass_of(f, axis, n.above_min);
      const float leaves_first = flip ? above_begin.high : below_end.high;
      const float enters_second = flip ? below_end.low : above_begin.low;
      const uint32_t first = flip ? above : below, second = flip ? below : above;
      const bool in_first = !(leaves_first < from), in_second = !(enters_second > to);
      if (in_second && in_first) *top++ = {second, enters_second > from ? enters_second : from, to};
      if (in_first) {
        node = first;
        if (leaves_first < to) to = leaves_first;
      } else if (in_second) {
        node = second;
        if (enters_second > from) from = enters_second;
      } else {
        is_between = true;
        break;
      }
    }
    if (!is_between && visit_list(nodes[node].list(), leaf)) return true;
    do {
      if (top == stack) return false;
      --top;
    } while (top->from > cull);
    node = top->node;
    from = top->from;
    to = top->to < cull ? top->to : cull;
  }
}

template <typename Triangles>
static const RayKernels* interval_kernels() {
  return &structure_kernels<LeafIntersector<Triangles>, IntervalData>;
}

}  // namespace umbel
