// Items sorted into the cells of a grid, which stand for single items where a node has too many
// to look at each.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/simd/box4.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {

struct Cell {
  Box4 box = Box4::empty();            ///< of its items; at the scale of the set
  uint32_t begin = 0, count = 0;       ///< its items, in CellSet::order
  std::array<uint16_t, 3> position{};  ///< in the grid
};

/// Layers of cells along each axis, by centre.
struct GridMapping {
  Float4 origin{}, scale{}, last{};

  Int4 position(Float4 center) const {
    return __builtin_convertvector(min4((center - origin) * scale, last), Int4);
  }
  /// Whether the centre may lie in the grid, and not beyond it.
  bool holds(Float4 center) const {
    const Float4 at = (center - origin) * scale;
    for (int k = 0; k < 3; ++k)
      if (!(at[k] > -0.5f && at[k] < last[k] + 1.5f)) return false;
    return true;
  }
};

struct CellSet {
  std::vector<uint32_t> order;  ///< items by cell, cells along a Morton curve
  std::vector<Cell> cells;      ///< that are not empty
  float scale = 1.0f;           ///< of the boxes: a power of two
  float centroid_scale = 1.0f;  ///< of given centroids: another
  GridMapping mapping;          ///< of centres at that scale
};

inline Box4 record_of(const Source& source, uint32_t item, float scale) {
  Box4 record = source.record(item);
  if (scale != 1.0f) record.scale(scale);
  return record;
}

/// A given centroid at `centroid_scale`, or the centre of the record. The record must have no tag:
/// as a float that is a denormal number, and slow to multiply.
inline Float4 item_center(const Source& source, const Box4& record, uint32_t item,
                          float centroid_scale) {
  if (source.centroids.empty()) return record.low * splat(0.5f) - record.negated_high * splat(0.5f);
  const Vec3& c = source.centroids[item];
  return Float4{c.x, c.y, c.z, 0} * splat(centroid_scale);
}

/// `bounds` is a box that holds all items where the caller knows one, or null: it saves a pass if
/// it is the smallest, and does not change the result. The result does not
/// depend on the order of `items`, except for the order within cells.
CellSet make_cells(const Source& source, const uint32_t* items, uint32_t count, const Box4* bounds);

}  // namespace umbel::cluster
