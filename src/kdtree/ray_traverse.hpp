// Three ways through a kd-tree, for any instruction set.
//
// A ray meets a plane somewhere in [low, high], the bounds of RayFrame, which are wide enough for
// all that is rounded (see query/ray_frame.hpp). The child on the side that the ray comes from is
// left at `high` at the latest, the other entered at `low` at the earliest, so near a plane both
// are visited: a ray that begins in a plane, or runs along it, is no special case, whatever its
// signs of zero. It is as if all cells were larger by about 2^-20 of the axis's
// largest coordinate.
//
// `Intersector` is made of a ray's frame; its triangles(tree, link, cull_back, t_max, hits) says
// which triangles of up to eight the ray meets. leaf(link) may lower `cull`, and ends the traversal
// by true.
#pragma once

#include "kdtree/ray_kernels.hpp"
#include "query/cell_rays.hpp"

namespace umbel {

/// Tests the triangles of a leaf.
template <typename Leaf>
static inline bool visit_leaf(const kdtree::Node& node, const Leaf& leaf) {
  return visit_list(node.list(), leaf);
}

/// Remembers which lists a ray was tested with last (Amanatides & Woo 1987 remember triangles):
/// large triangles reach through many cells, and leaves with the same triangles share their list.
class Mailbox {
 public:
  /// As visit_leaf, without the lists that are remembered.
  template <typename Leaf>
  bool visit(const kdtree::Node& node, const Leaf& leaf) {
    if (node.count() == 0) return false;
    uint32_t& known = firsts_[node.first % kLists];
    if (known == node.first) return false;
    known = node.first;
    return visit_leaf(node, leaf);
  }

 private:
  static constexpr uint32_t kLists = 8;
  uint32_t firsts_[kLists] = {kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone};
};

/// From near to far, the far child on a stack.
template <typename Leaf>
static inline bool traverse_with_stack(const KdTreeData& tree, const RayFrame& f,
                                       ClippedRay clipped, const float& cull, const Leaf& leaf) {
  CellEntry stack[kMaxKdDepth + 1];
  CellEntry* top = stack;
  Mailbox mailbox;
  const kdtree::Node* const nodes = tree.nodes.data();
  const uint32_t flips[3] = {f.inv[0] < 0.0f, f.inv[1] < 0.0f, f.inv[2] < 0.0f};
  uint32_t node = 0;
  float from = clipped.from, to = clipped.to;
  while (true) {
    while (!nodes[node].is_leaf()) {
      const kdtree::Node& n = nodes[node];
      const uint32_t axis = n.axis();
      const PlanePass pass = pass_of(f, axis, n.at);
      const uint32_t below = node + 1, above = n.above();
      const uint32_t first = flips[axis] ? above : below, second = flips[axis] ? below : above;
      if (pass.high < from) {
        node = second;
      } else if (pass.low > to) {
        node = first;
      } else {
        *top++ = {second, pass.low > from ? pass.low : from, to};
        if (pass.high < to) to = pass.high;
        node = first;
      }
    }
    if (mailbox.visit(nodes[node], leaf)) return true;
    do {
      if (top == stack) return false;
      --top;
    } while (top->from > cull);
    node = top->node;
    from = top->from;
    to = top->to < cull ? top->to : cull;
  }
}

/// With a stack that forgets its oldest entries. A bit of `trail` is set on each level where the
/// ray is done with the first child or has no other; to find what comes next after the stack has
/// run dry, the lowest such level that is not set is set, and the path is traversed again. For that
/// it has to be the same path, so `to` must not depend on hits. Long, because as one loop it keeps
/// its state in registers.
template <typename Leaf>
static inline bool traverse_with_short_stack(const KdTreeData& tree, const RayFrame& f,
                                             ClippedRay clipped, const float& cull,
                                             const Leaf& leaf) {
  constexpr uint32_t kEntries = 4;
  struct Entry {
    CellEntry at;
    uint32_t level;
  };
  Entry ring[kEntries];
  uint32_t newest = 0, count = 0;
  // Level 0 is the highest bit; a 65th level has leaves only.
  uint64_t trail = 0;
  const auto bit = [](uint32_t level) { return uint64_t{1} << (63 - level); };
  const kdtree::Node* const nodes = tree.nodes.data();
  uint32_t node = 0, level = 0;
  float from = clipped.from, to = clipped.to;
  while (true) {
    while (!nodes[node].is_leaf()) {
      const kdtree::Node& n = nodes[node];
      const uint32_t axis = n.axis();
      const PlanePass pass = pass_of(f, axis, n.at);
      const bool flip = f.inv[axis] < 0.0f;
      const uint32_t first = flip ? n.above() : node + 1, second = flip ? node + 1 : n.above();
      if (pass.high < from) {
        node = second;
        trail |= bit(level);
      } else if (pass.low > to) {
        node = first;
        trail |= bit(level);
      } else {
        const float second_from = pass.low > from ? pass.low : from;
        if (trail & bit(level)) {
          node = second;
          from = second_from;
        } else {
          newest = (newest + 1) % kEntries;
          ring[newest] = {{second, second_from, to}, level};
          count = count < kEntries ? count + 1 : kEntries;
          if (pass.high < to) to = pass.high;
          node = first;
        }
      }
      ++level;
    }
    if (from <= cull && visit_leaf(nodes[node], leaf)) return true;
    // The deepest level above this leaf where the second child waits.
    const uint64_t path = level == 0 ? 0 : ~uint64_t{0} << (64 - level);
    const uint64_t waiting = path & ~trail;
    if (waiting == 0) return false;
    const uint64_t next = waiting & (~waiting + 1);
    trail = (trail & ~(next - 1)) | next;
    if (count > 0) {
      const Entry& entry = ring[newest];
      newest = (newest + kEntries - 1) % kEntries;
      --count;
      node = entry.at.node;
      from = entry.at.from;
      to = entry.at.to;
      level = entry.level + 1;
    } else {
      node = level = 0;
      from = clipped.from;
      to = clipped.to;
    }
  }
}

/// From leaf to leaf by ropes. `entry` is where the ray came into the cell, or as much of the ray
/// as cannot be told from that. Where a second axis has a plane within it, the ray may be on either
/// side of an edge, and the stack takes over from there: it visits all cells near the edge.
template <typename Leaf>
static inline bool traverse_with_ropes(const KdTreeData& tree, const RayFrame& f,
                                       ClippedRay clipped, const float& cull, const Leaf& leaf) {
  const kdtree::Node* const nodes = tree.nodes.data();
  const uint32_t flips[3] = {f.inv[0] < 0.0f, f.inv[1] < 0.0f, f.inv[2] < 0.0f};
  PlanePass entry = clipped.entry;
  int32_t entry_axis = clipped.entry_axis;
  uint32_t node = 0;
  while (true) {
    while (!nodes[node].is_leaf()) {
      const kdtree::Node& n = nodes[node];
      const auto axis = static_cast<int32_t>(n.axis());
      const PlanePass pass = pass_of(f, n.axis(), n.at);
      const uint32_t below = node + 1, above = n.above();
      const uint32_t first = flips[axis] ? above : below, second = flips[axis] ? below : above;
      if (pass.high < entry.low) {
        node = second;
      } else if (pass.low > entry.high) {
        node = first;
      } else if (entry_axis == axis || entry_axis < 0) {
        entry_axis = axis;
        if (pass.high > entry.high) entry.high = pass.high;
        node = first;
      } else {
        clipped.from = entry.low;
        return traverse_with_stack(tree, f, clipped, cull, leaf);
      }
    }
    if (visit_leaf(nodes[node], leaf)) return true;
    const RopeLeaf& rope = tree.rope_leaves[tree.rope_leaf_of[node]];
    const float *low = &rope.cell.min.x, *high = &rope.cell.max.x;
    const PlanePass x = pass_of(f, 0, flips[0] ? low[0] : high[0]);
    const PlanePass y = pass_of(f, 1, flips[1] ? low[1] : high[1]);
    const PlanePass z = pass_of(f, 2, flips[2] ? low[2] : high[2]);
    PlanePass exit = x;
    int32_t axis = 0;
    float next = y.low;  // where the ray may leave through another face
    if (y.high < exit.high) {
      exit = y;
      axis = 1;
      next = x.low;
    }
    if (z.high < exit.high) {
      next = exit.low < next ? exit.low : next;
      exit = z;
      axis = 2;
    } else {
      next = z.low < next ? z.low : next;
    }
    const float soonest = next < exit.low ? next : exit.low;
    if (soonest > cull || soonest > clipped.to) return false;
    if (!(next > exit.high) || (axis != entry_axis && !(exit.low > entry.high))) {
      clipped.from = entry.low;
      return traverse_with_stack(tree, f, clipped, cull, leaf);
    }
    node = rope.ropes[2 * axis + (flips[axis] ? 0 : 1)];
    if (node == kNone) return false;
    entry = exit;
    entry_axis = axis;
  }
}

template <typename Triangles, kdtree::Traversal traversal>
class KdIntersector : public LeafIntersector<Triangles> {
 public:
  using LeafIntersector<Triangles>::LeafIntersector;
};

template <typename Triangles, kdtree::Traversal traversal, typename Leaf>
static inline bool traverse(const KdTreeData& tree,
                            const KdIntersector<Triangles, traversal>& intersector,
                            const float& cull, const Leaf& leaf) {
  ClippedRay clipped;
  const RayFrame& frame = intersector.frame();
  if (!clip_to_bounds(tree, frame, cull, clipped)) return false;
  if constexpr (traversal == kdtree::Traversal::kStack)
    return traverse_with_stack(tree, frame, clipped, cull, leaf);
  else if constexpr (traversal == kdtree::Traversal::kRopes)
    return traverse_with_ropes(tree, frame, clipped, cull, leaf);
  else
    return traverse_with_short_stack(tree, frame, clipped, cull, leaf);
}

template <typename Triangles>
static const RayKernels* kd_kernels(kdtree::Traversal traversal) {
  using kdtree::Traversal;
  switch (traversal) {
    case Traversal::kRopes:
      return &structure_kernels<KdIntersector<Triangles, Traversal::kRopes>, KdTreeData>;
    case Traversal::kShortStack:
      return &structure_kernels<KdIntersector<Triangles, Traversal::kShortStack>, KdTreeData>;
    default:
      return &structure_kernels<KdIntersector<Triangles, Traversal::kStack>, KdTreeData>;
  }
}

}  // namespace umbel
