// Rays through a two-level grid, for any instruction set: from cell to cell (Amanatides & Woo, "A
// Fast Voxel Traversal Algorithm for Ray Tracing", 1987), with the bounds of
// query/cell_rays.hpp for where a plane is passed. Where a ray runs so close to an edge of
// cells that rounding would decide where it goes on, the grid is gone through by halves instead, as
// a kd-tree: that visits all cells near the edge.
#pragma once

#include "query/cell_rays.hpp"
#include "uniform/grid_data.hpp"

namespace umbel {

/// Where a ray is in one grid. `entry` is where it came into its cell, through a face across
/// `entry_axis` (-1: it begins there). `Tag` keeps the instruction sets' forms aclipped.
template <typename Tag>
class GridSteps {
 public:
  GridSteps(const RayFrame& f, const GridFrame& frame) : f_(f), frame_(frame) {}

  const std::array<uint32_t, 3>& at() const { return at_; }
  const PlanePass& entry() const { return entry_; }
  int32_t entry_axis() const { return entry_axis_; }
  const PlanePass& exit() const { return exit_; }
  float soonest() const { return soonest_; }

  /// False where it is not certain which cell that is.
  bool enter(const PlanePass& entry, int32_t entry_axis) {
    entry_ = entry;
    entry_axis_ = entry_axis;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      if (int32_t(axis) == entry_axis)
        at_[axis] = flips(axis) ? frame_.size[axis] - 1u : 0u;
      else if (!locate(axis))
        return false;
      next_[axis] = pass_of(f_, axis, plane_ahead(axis));
    }
    return true;
  }

  /// Finds where the ray leaves its cell; false where it is not certain through which face.
  bool find_exit() {
    exit_ = next_[0];
    exit_axis_ = 0;
    float other = next_[1].low;
    if (next_[1].high < exit_.high) {
      exit_ = next_[1];
      exit_axis_ = 1;
      other = next_[0].low;
    }
    if (next_[2].high < exit_.high) {
      other = exit_.low < other ? exit_.low : other;
      exit_ = next_[2];
      exit_axis_ = 2;
    } else {
      other = next_[2].low < other ? next_[2].low : other;
    }
    soonest_ = other < exit_.low ? other : exit_.low;
    return other > exit_.high && (exit_axis_ == entry_axis_ || exit_.low > entry_.high);
  }

  /// Goes on to the next cell; false where that is outside of the grid.
  bool step() {
    entry_ = exit_;
    entry_axis_ = exit_axis_;
    const auto axis = static_cast<uint32_t>(exit_axis_);
    const uint32_t last = flips(axis) ? 0 : frame_.size[axis] - 1u;
    if (at_[axis] == last) return false;
    at_[axis] += flips(axis) ? ~0u : 1u;
    next_[axis] = pass_of(f_, axis, plane_ahead(axis));
    return true;
  }

  /// Goes on as the ray did in the cell's own grid, which it has left.
  bool step_as(const GridSteps& inner) {
    exit_ = inner.entry_;
    exit_axis_ = inner.entry_axis_;
    return step();
  }

 private:
  bool flips(uint32_t axis) const { return f_.inv[axis] < 0.0f; }
  float plane_ahead(uint32_t axis) const {
    return frame_.plane(axis, at_[axis] + (flips(axis) ? 0 : 1));
  }

  /// Finds the cell on an axis where the entry is, certainly behind one plane and before the next.
  bool locate(uint32_t axis) {
    const uint32_t size = frame_.size[axis];
    const float low = component(frame_.box.min, axis), high = component(frame_.box.max, axis);
    const float here = (entry_.low - f_.near_b[axis]) / f_.inv[axis];
    const float share = (here - low) / (high - low) * float(size);
    // A NaN, as of a flat box, gives 0.
    uint32_t k = share > 0 ? static_cast<uint32_t>(std::min(share, float(size - 1))) : 0;
    const bool flip = flips(axis);
    for (int tries = 0; tries < 3; ++tries) {
      const bool is_first = k == (flip ? size - 1 : 0), is_last = k == (flip ? 0 : size - 1);
      const PlanePass behind = pass_of(f_, axis, frame_.plane(axis, flip ? k + 1 : k));
      const PlanePass ahead = pass_of(f_, axis, frame_.plane(axis, flip ? k : k + 1));
      const bool is_behind = is_first || behind.high < entry_.low;
      const bool is_ahead = is_last || ahead.low > entry_.high;
      if (is_behind && is_ahead) {
        at_[axis] = k;
        return true;
      }
      if (!is_behind && behind.low > entry_.high)
        k += flip ? 1u : ~0u;
      else if (!is_ahead && ahead.high < entry_.low)
        k += flip ? ~0u : 1u;
      else
        return false;
    }
    return false;
  }

  const RayFrame& f_;
  GridFrame frame_;
  std::array<uint32_t, 3> at_{};
  PlanePass entry_{}, exit_{};
  PlanePass next_[3]{};
  int32_t entry_axis_ = -1, exit_axis_ = 0;
  float soonest_ = 0;
};

/// By halves, with a stack.
template <typename Leaf>
static bool traverse_by_halves(const GridData& grid, const RayFrame& f, const ClippedRay& clipped,
                               const float& cull, const Leaf& leaf) {
  struct Entry {
    GridName name;
    float from, to;
  };
  Entry stack[kMaxGridDepth + 1];
  Entry* top = stack;
  const GridNodes nodes(grid);
  GridNodes::Link here = nodes.root();
  float from = clipped.from, to = clipped.to;
  while (true) {
    while (!GridNodes::is_leaf(here)) {
      const GridNodes::Split split = nodes.split(here.name);
      const PlanePass pass = pass_of(f, split.axis, split.at);
      const bool flip = f.inv[split.axis] < 0.0f;
      const GridName &first = flip ? split.above : split.below,
                     &second = flip ? split.below : split.above;
      if (pass.high < from) {
        here.name = second;
      } else if (pass.low > to) {
        here.name = first;
      } else {
        *top++ = {second, pass.low > from ? pass.low : from, to};
        if (pass.high < to) to = pass.high;
        here.name = first;
      }
    }
    if (visit_list(nodes.leaf(here.name), leaf)) return true;
    do {
      if (top == stack) return false;
      --top;
    } while (top->from > cull);
    here.name = top->name;
    from = top->from;
    to = top->to < cull ? top->to : cull;
  }
}

enum class GridEnd { kHit, kPast, kOutside, kUncertain };

/// Through the cells of one top cell, whose steps `inner` are.
template <typename Tag, typename Leaf>
static inline GridEnd traverse_inner(const GridData& grid, const TopCell& top,
                                     GridSteps<Tag>& inner, float to, const float& cull,
                                     const Leaf& leaf) {
  const GridFrame size{{}, top.size};
  while (true) {
    const auto& at = inner.at();
    if (visit_list(grid.cells[top.first + size.index(at[0], at[1], at[2])], leaf))
      return GridEnd::kHit;
    const bool is_certain = inner.find_exit();
    if (inner.soonest() > cull || inner.soonest() > to) return GridEnd::kPast;
    if (!is_certain) return GridEnd::kUncertain;
    if (!inner.step()) return GridEnd::kOutside;
  }
}

template <typename Triangles, typename Leaf>
static inline bool traverse_cells(const GridData& grid, const RayFrame& f, ClippedRay& clipped,
                                  const float& cull, const Leaf& leaf) {
  GridSteps<Triangles> top(f, grid.frame);
  if (clipped.entry_axis == 3 || !top.enter(clipped.entry, clipped.entry_axis))
    return traverse_by_halves(grid, f, clipped, cull, leaf);
  while (true) {
    GridSteps<Triangles> inner(f, grid.inner(top.at()));
    GridEnd end = GridEnd::kUncertain;
    if (inner.enter(top.entry(), top.entry_axis()))
      end =
          traverse_inner(grid, grid.tops[grid.top_index(top.at())], inner, clipped.to, cull, leaf);
    if (end == GridEnd::kHit) return true;
    if (end == GridEnd::kPast) return false;
    if (end == GridEnd::kUncertain) {
      clipped.from = inner.entry().low;
      return traverse_by_halves(grid, f, clipped, cull, leaf);
    }
    if (!top.step_as(inner)) return false;
  }
}

template <typename Triangles>
static const RayKernels* grid_kernels() {
  return &structure_kernels<LeafIntersector<Triangles>, GridData>;
}

}  // namespace umbel
