// How space is cut into units: k-d trees between the cells of grids.
//
// The first grid is around everything. A cell with too many triangles for a unit has a grid of its
// own, and where that does not help, its triangles are dealt out by their order in the source. A
// crack cannot come of it: what a unit shares with others is known by the bits of positions alone.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::scale {

/// Cells of equal size around a box, `resolution` along each axis.
struct CellGrid {
  Vec3 low{0, 0, 0}, high{0, 0, 0};
  uint32_t resolution = 1;

  /// The cell that a point is in; one outside is in the nearest.
  std::array<uint32_t, 3> cell_of(const Vec3& point) const;
  /// The corners of a cell, as near as floats come.
  CellGrid within(const std::array<uint32_t, 3>& cell, uint32_t cells) const;
  size_t cells() const { return size_t{resolution} * resolution * resolution; }
  size_t number(const std::array<uint32_t, 3>& cell) const {
    return (size_t{cell[2]} * resolution + cell[1]) * resolution + cell[0];
  }
};

/// Units are numbered from 0. It does not depend on memory, machines or processes.
class Partition {
 public:
  /// One unit for all.
  Partition() : nodes_{{Kind::kUnit, 0, 0, 0, 1}}, units_(1) {}

  uint32_t units() const { return units_; }
  /// The unit that owns a position: where several units share a place, the first of them.
  uint32_t home(const Vec3& position) const { return nodes_[leaf(position)].first; }
  /// The leaf that a triangle with this centroid is in.
  uint32_t leaf(const Vec3& centroid) const;
  /// Units of a leaf: [first, first + count).
  uint32_t first_unit(uint32_t leaf) const { return nodes_[leaf].first; }
  uint32_t unit_count(uint32_t leaf) const { return nodes_[leaf].second; }

  /// Leaves of several units, which share the triangles there by their order in the source.
  uint32_t shared_leaves() const;

  /// Little-endian, for files.
  std::vector<std::byte> bytes() const;
  /// Throws kCorrupt.
  static Partition from_bytes(std::span<const std::byte> bytes);

 private:
  friend class PartitionBuilder;
  enum class Kind : uint32_t { kPlane, kGrid, kUnit };
  struct Node {
    Kind kind;
    uint32_t axis, plane;    // kPlane: cells below the plane go left
    uint32_t first, second;  // kPlane: children; kGrid: grid and root; kUnit: first unit, how many
  };

  std::vector<CellGrid> grids_{CellGrid{}};
  std::vector<Node> nodes_;
  uint32_t units_;
};

/// Where a unit's triangles lie: the middle of the corners.
inline Vec3 centroid(const Vec3& a, const Vec3& b, const Vec3& c) {
  const auto mean = [](float x, float y, float z) {
    return static_cast<float>((double{x} + y + z) / 3.0);
  };
  return {mean(a.x, b.x, c.x), mean(a.y, b.y, c.y), mean(a.z, b.z, c.z)};
}

}  // namespace umbel::scale
