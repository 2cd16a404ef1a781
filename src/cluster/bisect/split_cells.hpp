// Bisection of nodes that are too large for a Block, by the cells of a grid.
#pragma once

#include <functional>

#include "cluster/bisect/cells.hpp"
#include "cluster/bisect/split_constraints.hpp"

namespace umbel::cluster {

/// A part of a segment that is small enough for a Block, or that no grid can split. Its place
/// among the segment's items begins at `offset`.
struct Part {
  uint32_t offset = 0, count = 0;
  std::vector<Cell> cells;
};

/// Splits items[0, count) into parts of at most `most` items. Calls done(set, part) for each,
/// possibly from several threads at once. `bounds` as for make_cells.
void split_cells(const Source& source, const SplitConstraints& constraints, const uint32_t* items,
                 uint32_t count, uint32_t most, const BoxRecord* bounds,
                 const std::function<void(const CellSet&, const Part&)>& done);

}  // namespace umbel::cluster
