// Structures that divide space (kd-trees, grids, interval hierarchies) store planes, not boxes.
// Here are their cells as the queries of traverse_leaves.hpp see nodes: boxes that are computed on
// the way down.
#pragma once

#include <algorithm>

#include "base/axis.hpp"
#include "base/math.hpp"
#include "query/leaf_store.hpp"
#include "query/traverse_leaves.hpp"

namespace umbel {

/// The parts of a cell below and above a plane.
inline Aabb cell_below(Aabb cell, uint32_t axis, float plane) {
  component(cell.max, axis) = plane;
  return cell;
}
inline Aabb cell_above(Aabb cell, uint32_t axis, float plane) {
  component(cell.min, axis) = plane;
  return cell;
}

/// Half the surface area, in double: neither the largest nor the smallest cells overflow or vanish.
inline double cell_area(const Aabb& cell) {
  const double x = double(cell.max.x) - double(cell.min.x),
               y = double(cell.max.y) - double(cell.min.y),
               z = double(cell.max.z) - double(cell.min.z);
  return x * (y + z) + y * z;
}

/// How far triangles may lie outside of their cell on each axis. The rounding of clipping and of
/// building is far below it, and rays allow for as much (see ray_frame.hpp).
inline Vec3 cell_error_bound(const LeafStore& store) {
  const float* const most = store.max_abs_coord;
  const float furthest = std::max({most[0], most[1], most[2]}) * 0x1p-38f;
  return {most[0] * 0x1p-20f + furthest, most[1] * 0x1p-20f + furthest,
          most[2] * 0x1p-20f + furthest};
}

/// Names a node, or something like one, and has its cell.
template <typename Name>
struct CellLink {
  Name name;
  Aabb cell;
  bool operator==(const CellLink& o) const { return name == o.name; }
};

/// The two children of a cell, enlarged by the error bound.
template <typename Link>
class CellChildren {
 public:
  CellChildren(const Link& first, const Link& second, const Vec3& error) : links_{first, second} {
    for (uint32_t child = 0; child < 2; ++child) {
      const Aabb& cell = links_[child].cell;
      const float planes[6] = {cell.min.x - error.x, cell.max.x + error.x, cell.min.y - error.y,
                               cell.max.y + error.y, cell.min.z - error.z, cell.max.z + error.z};
      for (uint32_t i = 0; i < 6; ++i) planes_[2 * i + child] = planes[i];
    }
  }
  NodeBoxes<2> boxes() const { return {planes_}; }
  const Link& link(uint32_t child) const { return links_[child]; }

 private:
  float planes_[14] = {};  ///< two more than there are, as four are loaded at once
  Link links_[2];
};

}  // namespace umbel
