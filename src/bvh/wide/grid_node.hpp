// Nodes whose boxes lie on a grid of their own (as in Ylitie, Karras & Laine 2017): plane q of an
// axis is at origin + q * cell, cells are powers of two, and boxes are rounded outwards, so that
// what is not met in them is not there. In words:
//   3        the grid's origin, which is the lowest corner of all below the node: x, y, z
//   3        the size of its cells: x, y, z
//   6 rows   a plane of each child, in the order of plain nodes, as unsigned integers of GridPlane
//   width    links
// The boxes of children that are not there mean nothing.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "base/math.hpp"

namespace umbel::grid {

using GridPlane = uint16_t;
inline constexpr uint32_t kFirstRow = 6;
/// Those smaller could vanish in products.
inline constexpr float kLeastCell = 0x1p-100f;

constexpr uint32_t links_at(uint32_t width) {
  return kFirstRow + 6 * width * uint32_t{sizeof(GridPlane)} / 4;
}
constexpr uint32_t node_words(uint32_t width) { return links_at(width) + width; }

/// Where a plane is, rounded to the nearest: as that keeps the order of numbers, a plane below x
/// stays there. Always finite.
inline float position(float origin, float cell, uint32_t plane) {
  return std::min(origin + static_cast<float>(plane) * cell, std::numeric_limits<float>::max());
}

/// The grid of one axis of a node, which reaches from `low` to `high`.
class Axis {
 public:
  Axis(float low, float high) : origin_(low) {
    // Halved, so that no difference overflows. Its bits without those of the mantissa are the power
    // of two below it, of which a cell is at least the 2^15th part.
    const float extent = high * 0.5f - low * 0.5f;
    const uint32_t power = std::bit_cast<uint32_t>(extent) & 0x7f800000u;
    cell_ = std::max(std::bit_cast<float>(power) * 0x1p-15f, kLeastCell);
    while (position(low, cell_, kMost) < high) cell_ *= 2;
    cells_in_half_ = 2 / cell_;
  }
  float origin() const { return origin_; }
  float cell() const { return cell_; }
  /// The last plane that is not above x.
  GridPlane below(float x) const {
    uint32_t plane = near(x);
    while (plane > 0 && position(origin_, cell_, plane) > x) --plane;
    return static_cast<GridPlane>(plane);
  }
  /// The first plane that is not below x.
  GridPlane above(float x) const {
    uint32_t plane = near(x);
    while (plane < kMost && position(origin_, cell_, plane) < x) ++plane;
    return static_cast<GridPlane>(plane);
  }

 private:
  static constexpr uint32_t kMost = std::numeric_limits<GridPlane>::max();

  uint32_t near(float x) const {
    const float cells = (x * 0.5f - origin_ * 0.5f) * cells_in_half_;
    return static_cast<uint32_t>(std::min(cells, static_cast<float>(kMost)));
  }

  float origin_, cell_ = 0, cells_in_half_ = 0;
};

inline GridPlane plane_of(const uint32_t* node, uint32_t width, uint32_t row, uint32_t slot) {
  GridPlane plane;
  std::memcpy(&plane,
              reinterpret_cast<const unsigned char*>(node + kFirstRow) +
                  sizeof plane * (size_t{row} * width + slot),
              sizeof plane);
  return plane;
}

inline void set_plane(uint32_t* node, uint32_t width, uint32_t row, uint32_t slot,
                      GridPlane plane) {
  std::memcpy(reinterpret_cast<unsigned char*>(node + kFirstRow) +
                  sizeof plane * (size_t{row} * width + slot),
              &plane, sizeof plane);
}

/// A plane of a child, 0 to 5 in the order of the rows.
inline float position_of(const uint32_t* node, uint32_t width, uint32_t row, uint32_t slot) {
  return position(std::bit_cast<float>(node[row / 2]), std::bit_cast<float>(node[3 + row / 2]),
                  plane_of(node, width, row, slot));
}

inline Aabb box(const uint32_t* node, uint32_t width, uint32_t slot) {
  const auto at = [&](uint32_t row) { return position_of(node, width, row, slot); };
  return {{at(0), at(2), at(4)}, {at(1), at(3), at(5)}};
}

/// Whether a node has an origin and cells such as set_boxes makes.
inline bool is_grid(const uint32_t* node) {
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const float cell = std::bit_cast<float>(node[3 + axis]);
    constexpr uint32_t kMantissa = 0x7fffff;
    if (!(std::abs(std::bit_cast<float>(node[axis])) <= std::numeric_limits<float>::max()) ||
        !(cell >= kLeastCell && cell <= std::numeric_limits<float>::max()) ||
        (node[3 + axis] & kMantissa) != 0)
      return false;
  }
  return true;
}

/// Writes the grid and all boxes of a node; empty ones are of children that are not there.
inline void set_boxes(uint32_t* node, uint32_t width, const Aabb* boxes) {
  Aabb all;
  for (uint32_t slot = 0; slot < width; ++slot) extend(all, boxes[slot]);
  const auto set_axis = [&](uint32_t number, float Vec3::* along) {
    const Axis axis(all.min.*along, all.max.*along);
    node[number] = std::bit_cast<uint32_t>(axis.origin());
    node[3 + number] = std::bit_cast<uint32_t>(axis.cell());
    for (uint32_t slot = 0; slot < width; ++slot) {
      const bool is_there = !is_empty(boxes[slot]);
      set_plane(node, width, 2 * number, slot,
                is_there ? axis.below(boxes[slot].min.*along) : GridPlane{0});
      set_plane(node, width, 2 * number + 1, slot,
                is_there ? axis.above(boxes[slot].max.*along) : GridPlane{0});
    }
  };
  set_axis(0, &Vec3::x);
  set_axis(1, &Vec3::y);
  set_axis(2, &Vec3::z);
}

}  // namespace umbel::grid
