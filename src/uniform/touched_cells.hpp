// Which cells of a grid a triangle touches: those within its box that its plane and its edges do
// not miss (Schwarz & Seidel, "Fast Parallel Surface and Solid Voxelization on GPUs", 2010). In
// double and with a margin, so that a cell too many may be found and none is lost.
#pragma once

#include <algorithm>
#include <cmath>

#include "query/triangle_geometry.hpp"
#include "uniform/grid_data.hpp"

namespace umbel {

/// Cells first .. last on each axis, both ends included.
struct CellBlock {
  uint32_t first[3], last[3];
  uint64_t count() const {
    uint64_t product = 1;
    for (uint32_t axis = 0; axis < 3; ++axis) product *= last[axis] - first[axis] + 1;
    return product;
  }
};

/// The cells that touch a box which touches the frame's.
inline CellBlock block_of(const GridFrame& frame, const Aabb& box) {
  CellBlock block;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const uint32_t size = frame.size[axis];
    const double low = component(frame.box.min, axis),
                 width = double(component(frame.box.max, axis)) - low;
    const auto guess = [&](float at) {
      const double share = width > 0 ? (double(at) - low) / width * size : 0;
      return static_cast<uint32_t>(std::clamp(share, 0.0, double(size - 1)));
    };
    const float from = component(box.min, axis), to = component(box.max, axis);
    uint32_t first = guess(from), last = guess(to);
    while (first > 0 && frame.plane(axis, first) >= from) --first;
    while (first + 1 < size && frame.plane(axis, first + 1) < from) ++first;
    while (last + 1 < size && frame.plane(axis, last + 1) <= to) ++last;
    while (last > first && frame.plane(axis, last) > to) --last;
    block.first[axis] = first;
    block.last[axis] = last;
  }
  return block;
}

class CellTest {
 public:
  explicit CellTest(const TriangleCorners& c)
      : corners_{to_double(c[0]), to_double(c[1]), to_double(c[2])} {
    const Vec3d a = corners_[1] - corners_[0], b = corners_[2] - corners_[0];
    normal_ = cross(a, b);
    double max_abs_coord = 0;
    for (const Vec3d& p : corners_)
      max_abs_coord = std::max({max_abs_coord, std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
    margin_ = max_abs_coord * 0x1p-40;
    normal_margin_ = (length(a) * length(b)) * max_abs_coord * 0x1p-44;
  }

  bool touches(const Aabb& cell) const {
    const Vec3d low = to_double(cell.min), high = to_double(cell.max);
    const Vec3d middle = (low + high) * 0.5;
    const Vec3d half = (high - low) * 0.5 + Vec3d{margin_, margin_, margin_};
    const double extent = std::fabs(normal_.x) * half.x + std::fabs(normal_.y) * half.y +
                          std::fabs(normal_.z) * half.z;
    if (std::fabs(dot(normal_, middle - corners_[0])) > extent + normal_margin_) return false;
    return !is_apart(&Vec3d::x, &Vec3d::y, middle, half) &&
           !is_apart(&Vec3d::y, &Vec3d::z, middle, half) &&
           !is_apart(&Vec3d::z, &Vec3d::x, middle, half);
  }

 private:
  using Part = double Vec3d::*;

  /// Whether a side of the triangle's projection has the rectangle beyond it.
  bool is_apart(Part x, Part y, const Vec3d& middle, const Vec3d& half) const {
    for (uint32_t i = 0; i < 3; ++i) {
      const Vec3d &p = corners_[i], &q = corners_[(i + 1) % 3], &r = corners_[(i + 2) % 3];
      const double ex = q.*x - p.*x, ey = q.*y - p.*y;
      const auto side = [&](const Vec3d& c) { return ex * (c.*y - p.*y) - ey * (c.*x - p.*x); };
      const double turn = side(r), at = side(middle);
      const double extent = std::fabs(ex) * half.*y + std::fabs(ey) * half.*x +
                            (std::fabs(ex) + std::fabs(ey)) * margin_;
      if ((turn >= 0 && at < -extent) || (turn <= 0 && at > extent)) return true;
    }
    return false;
  }

  Vec3d corners_[3];
  Vec3d normal_;
  double margin_, normal_margin_;
};

/// Calls visit(x, y, z) for each cell of a block that the triangle touches.
template <typename Visit>
void for_touched_cells(const GridFrame& frame, const CellBlock& block,
                       const TriangleCorners& corners, const Visit& visit) {
  const bool is_one = block.count() == 1;
  const CellTest test(corners);
  for (uint32_t z = block.first[2]; z <= block.last[2]; ++z)
    for (uint32_t y = block.first[1]; y <= block.last[1]; ++y)
      for (uint32_t x = block.first[0]; x <= block.last[0]; ++x)
        if (is_one || test.touches(frame.cell(x, y, z))) visit(x, y, z);
}

}  // namespace umbel
