// Bisection of nodes that are too large for a Block, by the cells of a grid.
#pragma once

#include <functional>

#include "cluster/bisect/cells.hpp"
#include "cluster/bisect/segment.hpp"

namespace umbel::cluster {

/// A part of a segment that is small enough for a Block, or that no grid can split. Its items
/// begin at `offset` of the segment's.
struct Part {
  uint32_t offset = 0, count = 0;
  std::vector<Cell> cells;
};

/// Splits a segment into parts of at most `most` items. Calls done(set, part) for each, possibly
/// from several threads at once. `bounds` as for make_cells.
void split_cells(const Segment& segment, uint32_t most, const Box4* bounds,
                 const std::function<void(const CellSet&, const Part&)>& done);

}  // namespace umbel::cluster
