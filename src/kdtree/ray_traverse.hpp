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

/// The part of a ray within the bounds. NaN, which extreme numbers may lead to, cuts off nothing.
struct RayPart {
  float from, to;
  PlanePass entry;     ///< where the ray comes in
  int32_t entry_axis;  ///< of the face there; 3: there are several; -1: it begins inside
};

static inline bool enter_bounds(const LeafStore& tree, const RayFrame& f, float cull,
                                RayPart& part) {
  part.from = f.t_min;
  part.to = cull;
  const Vec3 &least = tree.bounds.min, &most = tree.bounds.max;
  const float low[3] = {least.x, least.y, least.z}, high[3] = {most.x, most.y, most.z};
  float near_high[3];
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const bool flip = f.inv[axis] < 0.0f;
    const PlanePass near = pass_of(f, axis, flip ? high[axis] : low[axis]);
    const PlanePass far = pass_of(f, axis, flip ? low[axis] : high[axis]);
    near_high[axis] = near.high;
    if (near.low > part.from) part.from = near.low;
    if (far.high < part.to) part.to = far.high;
  }
  part.entry = {part.from, f.t_min};
  part.entry_axis = -1;
  for (int32_t axis = 0; axis < 3; ++axis) {
    if (near_high[axis] < part.from) continue;
    part.entry_axis = part.entry_axis < 0 ? axis : 3;
    if (near_high[axis] > part.entry.high) part.entry.high = near_high[axis];
  }
  return part.from <= part.to;
}

/// Tests the triangles of a leaf, eight at a time.
template <typename Leaf>
static inline bool visit_leaf(const kdtree::Node& node, const Leaf& leaf) {
  uint32_t first = node.first;
  for (uint32_t rest = node.count(); rest > 0;) {
    const uint32_t count = rest < kMaxLeafTriangles ? rest : kMaxLeafTriangles;
    if (leaf(LeafStore::leaf_link(first, count))) return true;
    first += count;
    rest -= count;
  }
  return false;
}

/// Remembers which lists a ray was tested with last (Amanatides & Woo 1987 remember triangles):
/// large triangles reach through many cells, and leaves with the same triangles share their list.
class Mailbox {
 public:
  /// As visit_leaf, but for what is remembered.
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

struct KdEntry {
  uint32_t node;
  float from, to;
};

/// From near to far, the far child on a stack.
template <typename Leaf>
static inline bool traverse_with_stack(const KdTreeData& tree, const RayFrame& f, RayPart part,
                                       const float& cull, const Leaf& leaf) {
  KdEntry stack[kMaxKdDepth + 1];
  KdEntry* top = stack;
  Mailbox mailbox;
  const kdtree::Node* const nodes = tree.nodes.data();
  const uint32_t flips[3] = {f.inv[0] < 0.0f, f.inv[1] < 0.0f, f.inv[2] < 0.0f};
  uint32_t node = 0;
  float from = part.from, to = part.to;
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
/// run dry, the lowest such level that is not set is set, and the path is walked again. For that
/// it has to be the same path, so `to` must not depend on hits.
template <typename Leaf>
static inline bool traverse_with_short_stack(const KdTreeData& tree, const RayFrame& f,
                                             RayPart part, const float& cull, const Leaf& leaf) {
  constexpr uint32_t kEntries = 4;
  struct Entry {
    KdEntry at;
    uint32_t level;
  };
  Entry ring[kEntries];
  uint32_t newest = 0, count = 0;
  // Level 0 is the highest bit; a 65th level has leaves only.
  uint64_t trail = 0;
  const auto bit = [](uint32_t level) { return uint64_t{1} << (63 - level); };
  const kdtree::Node* const nodes = tree.nodes.data();
  uint32_t node = 0, level = 0;
  float from = part.from, to = part.to;
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
      from = part.from;
      to = part.to;
    }
  }
}

/// From leaf to leaf by ropes. `entry` is where the ray came into the cell, or as much of the ray
/// as cannot be told from that. Where a second axis has a plane within it, the ray may be on either
/// side of an edge, and the stack takes over from there: it visits all cells near the edge.
template <typename Leaf>
static inline bool traverse_with_ropes(const KdTreeData& tree, const RayFrame& f, RayPart part,
                                       const float& cull, const Leaf& leaf) {
  const kdtree::Node* const nodes = tree.nodes.data();
  const uint32_t flips[3] = {f.inv[0] < 0.0f, f.inv[1] < 0.0f, f.inv[2] < 0.0f};
  PlanePass entry = part.entry;
  int32_t entry_axis = part.entry_axis;
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
        part.from = entry.low;
        return traverse_with_stack(tree, f, part, cull, leaf);
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
    if (soonest > cull || soonest > part.to) return false;
    if (!(next > exit.high) || (axis != entry_axis && !(exit.low > entry.high))) {
      part.from = entry.low;
      return traverse_with_stack(tree, f, part, cull, leaf);
    }
    node = rope.ropes[2 * axis + (flips[axis] ? 0 : 1)];
    if (node == kNone) return false;
    entry = exit;
    entry_axis = axis;
  }
}

/// What the queries of query/ray_traverse.hpp are made with.
template <typename Triangles>
class FrameLanes {
 public:
  FrameLanes(const RayFrame& frame, const LeafStore& /*tree*/) : frame_(frame), triangles_(frame) {}
  const RayFrame& frame() const { return frame_; }
  uint32_t triangles(const LeafStore& tree, uint32_t link, bool cull_back, float t_max,
                     LeafHits& hits) const {
    return triangles_(tree, link, cull_back, t_max, hits);
  }

 private:
  const RayFrame& frame_;
  Triangles triangles_;
};

template <typename Triangles, kdtree::Traversal traversal>
class KdIntersector : public FrameLanes<Triangles> {
 public:
  using FrameLanes<Triangles>::FrameLanes;
};

template <typename Triangles, kdtree::Traversal traversal, typename Leaf>
static inline bool traverse(const KdTreeData& tree,
                            const KdIntersector<Triangles, traversal>& intersector,
                            const float& cull, const Leaf& leaf) {
  RayPart part;
  const RayFrame& frame = intersector.frame();
  if (!enter_bounds(tree, frame, cull, part)) return false;
  if constexpr (traversal == kdtree::Traversal::kStack)
    return traverse_with_stack(tree, frame, part, cull, leaf);
  else if constexpr (traversal == kdtree::Traversal::kRopes)
    return traverse_with_ropes(tree, frame, part, cull, leaf);
  else
    return traverse_with_short_stack(tree, frame, part, cull, leaf);
}

template <typename Intersector, typename Tree>
constexpr RayKernels structure_kernels{intersect_ray<Intersector, Tree>,
                                       occluded_ray<Intersector, Tree>,
                                       all_hits_ray<Intersector, Tree>};

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
