// What a TwoLevelGrid holds, and its cells as queries see them: ranges of cells that are halved
// until one cell is left, as if the grid were a kd-tree.
#pragma once

#include <array>

#include "query/cells.hpp"
#include "query/leaf_lists.hpp"
#include "uniform/structure_data.hpp"

namespace umbel {

inline constexpr uint32_t kMostCells = 255;  ///< an axis
/// Halvings of both levels' three axes.
inline constexpr uint32_t kMaxGridDepth = 2 * 3 * 8;

// Inlined always, because rays are compiled for several instruction sets.
#define UMBEL_GRID [[gnu::always_inline]]

using GridSize = std::array<uint8_t, 3>;

/// A box divided by planes at equal distances.
struct GridFrame {
  Aabb box;
  GridSize size{1, 1, 1};

  /// Plane k of 0 .. size; the first and the last are the box's own.
  UMBEL_GRID float plane(uint32_t axis, uint32_t k) const {
    const float low = component(box.min, axis), high = component(box.max, axis);
    if (k == size[axis]) return high;
    return static_cast<float>(double(low) + (double(high) - double(low)) * k / size[axis]);
  }
  uint32_t count() const { return uint32_t{size[0]} * size[1] * size[2]; }
  UMBEL_GRID uint32_t index(uint32_t x, uint32_t y, uint32_t z) const {
    return (z * size[1] + y) * size[0] + x;
  }
  UMBEL_GRID Aabb cell(uint32_t x, uint32_t y, uint32_t z) const {
    return {{plane(0, x), plane(1, y), plane(2, z)},
            {plane(0, x + 1), plane(1, y + 1), plane(2, z + 1)}};
  }
};

/// A cell of the top level: the size of its grid, and the first of that grid's cells.
struct TopCell {
  uint32_t first = 0;
  GridSize size{1, 1, 1};
};

struct GridData : UniformData {
  GridFrame frame;
  BigVector<TopCell> tops;
  BigVector<Range> cells;  ///< the references of each

  UMBEL_GRID uint32_t top_index(const std::array<uint32_t, 3>& at) const {
    return frame.index(at[0], at[1], at[2]);
  }
  UMBEL_GRID GridFrame inner(const std::array<uint32_t, 3>& at) const {
    return {frame.cell(at[0], at[1], at[2]), tops[top_index(at)].size};
  }
};

/// Cells low .. high - 1 of a grid.
struct GridRange {
  GridSize low, high;
  UMBEL_GRID uint32_t extent(uint32_t axis) const { return uint32_t(high[axis]) - low[axis]; }
  UMBEL_GRID bool is_one() const { return extent(0) == 1 && extent(1) == 1 && extent(2) == 1; }
  bool operator==(const GridRange&) const = default;
};

/// A range of top cells, or of the cells of one of them.
struct GridName {
  GridRange top;  ///< one cell where `inner` means something
  GridRange inner;
  bool operator==(const GridName&) const = default;
};

/// For the queries of query/traverse_leaves.hpp.
class GridNodes {
 public:
  static constexpr uint32_t kWidth = 2, kDepth = kMaxGridDepth;
  using Link = CellLink<GridName>;
  static constexpr Link kNoLink{{{{1, 1, 1}, {0, 0, 0}}, {{0, 0, 0}, {0, 0, 0}}}, {}};

  explicit GridNodes(const LeafStore& store)
      : data_(static_cast<const GridData&>(store)), error_(cell_error_bound(store)) {}

  UMBEL_GRID Link root() const { return {named({{0, 0, 0}, data_.frame.size}), data_.bounds}; }
  UMBEL_GRID static bool is_leaf(const Link& link) {
    return link.name.top.is_one() && link.name.inner.is_one();
  }

  /// The plane between the halves of a range.
  struct Split {
    uint32_t axis;
    float at;
    GridName below, above;
  };
  UMBEL_GRID Split split(const GridName& name) const {
    if (!name.top.is_one()) {
      const auto [axis, middle, below, above] = halves(name.top);
      return {axis, data_.frame.plane(axis, middle), named(below), named(above)};
    }
    const auto [axis, middle, below, above] = halves(name.inner);
    return {axis,
            data_.inner(corner(name.top)).plane(axis, middle),
            {name.top, below},
            {name.top, above}};
  }
  CellChildren<Link> children(const Link& link) const {
    const Split s = split(link.name);
    return {{s.below, cell_below(link.cell, s.axis, s.at)},
            {s.above, cell_above(link.cell, s.axis, s.at)},
            error_};
  }
  UMBEL_GRID const Range& leaf(const GridName& name) const {
    const TopCell& top = data_.tops[data_.top_index(corner(name.top))];
    const GridFrame inner{{}, top.size};
    const auto at = corner(name.inner);
    return data_.cells[top.first + inner.index(at[0], at[1], at[2])];
  }
  template <typename Visit>
  void visit_runs(const Link& link, const Visit& visit) const {
    visit_links(leaf(link.name), visit);
  }
  bool repeats() const { return true; }

 private:
  struct Halves {
    uint32_t axis, middle;
    GridRange below, above;
  };
  UMBEL_GRID static Halves halves(const GridRange& range) {
    uint32_t axis = 0;
    for (uint32_t a = 1; a < 3; ++a)
      if (range.extent(a) > range.extent(axis)) axis = a;
    const uint32_t middle = range.low[axis] + range.extent(axis) / 2;
    Halves h{axis, middle, range, range};
    h.below.high[axis] = h.above.low[axis] = static_cast<uint8_t>(middle);
    return h;
  }
  UMBEL_GRID static std::array<uint32_t, 3> corner(const GridRange& range) {
    return {range.low[0], range.low[1], range.low[2]};
  }
  UMBEL_GRID GridName named(const GridRange& top) const {
    if (!top.is_one()) return {top, {{0, 0, 0}, {0, 0, 0}}};
    return {top, {{0, 0, 0}, data_.tops[data_.top_index(corner(top))].size}};
  }

  const GridData& data_;
  Vec3 error_;
};

#undef UMBEL_GRID

}  // namespace umbel
