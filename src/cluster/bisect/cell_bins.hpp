// The cells of a node in bins along each axis, whose borders are the planes that may split it.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "cluster/bisect/cells.hpp"

namespace umbel::cluster {

inline constexpr int kCellBins = 64;

/// The layers of a grid that a node's cells lie in.
struct CellExtent {
  std::array<int, 3> low{1 << 16, 1 << 16, 1 << 16}, high{-1, -1, -1};
  std::array<int, 3> shift{};  ///< layers of a bin: 2^shift
  Box4 box = Box4::empty();

  explicit CellExtent(std::span<const Cell> cells) {
    for (const Cell& cell : cells) {
      box.extend(cell.box);
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min<int>(low[k], cell.position[k]);
        high[k] = std::max<int>(high[k], cell.position[k]);
      }
    }
    for (int k = 0; k < 3; ++k)
      while ((high[k] >> shift[k]) - (low[k] >> shift[k]) >= kCellBins) ++shift[k];
  }
  bool single() const { return low == high; }
  int bin(int axis, int layer) const { return (layer >> shift[axis]) - (low[axis] >> shift[axis]); }
};

/// Something about each plane of three axes: [axis][b] is between the bins below b and the others.
using AtPlanes = std::array<std::array<float, kCellBins>, 3>;

}  // namespace umbel::cluster
