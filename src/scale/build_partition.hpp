// The second pass: counts in cells, and the units that come of them.
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "io/source/triangle_source.hpp"
#include "scale/partition.hpp"
#include "scale/point_rule.hpp"
#include "scale/taken_positions.hpp"

namespace umbel::scale {

struct PartitionConfig {
  uint64_t capacity = uint64_t{4} << 20;  ///< most triangles of a unit
  uint32_t tier = 0;  ///< in odd ones the first plane across each axis is at a third
  uint32_t resolution = 256;
  uint32_t inner_resolution = 32;  ///< of cells that have too many triangles
  uint32_t most_grids = 4;         ///< one within another; then triangles are dealt out by order
};

/// Counts in the cells of grids. Those of parts of the input add up. A cell of 2^32 triangles or
/// more is kUnsupported.
struct CellCounts {
  std::vector<std::vector<uint32_t>> grids;
  void merge(const CellCounts& other);
};

/// Makes a partition in rounds: each counts what the grids of the round need, which are in
/// `counts`, and `advance` cuts them into units. Mostly there is one round.
class PartitionBuilder {
 public:
  /// `box` is around all positions.
  PartitionBuilder(const Aabb& box, const PartitionConfig& config);

  bool is_done() const { return pending_.empty(); }
  /// Zeros for this round's grids.
  CellCounts empty_counts() const;
  /// Counts things with this centroid, in the grid of this round that it is in, if it is in one.
  void count(CellCounts& counts, const Vec3& centroid, uint32_t weight) const;
  void advance(const CellCounts& counts);
  Partition finished() const { return partition_; }

 private:
  /// A leaf that becomes a grid once it is counted.
  struct Pending {
    uint32_t node, grid, depth;
  };
  struct Cells;
  void cut(const Cells& cells, uint32_t node, uint32_t used);
  void fill(const Cells& cells, uint32_t node);
  uint32_t new_unit(uint64_t weight);

  PartitionConfig config_;
  Partition partition_;
  std::vector<Pending> pending_, next_;
};

/// What a pass finds besides: of parts of the input it adds up.
struct SourceMeasure {
  uint64_t digest = 0;      ///< triangle_set_digest
  uint64_t degenerate = 0;  ///< triangles that lost their area as positions were rounded
  double largest_move = 0;  ///< of a vertex, by that
  uint64_t is_exact = 0;    ///< given: nothing is rounded
};

/// What a pass does besides, where that is asked for.
struct CellPass {
  SourceMeasure* measure = nullptr;
  TakenPositions* taken = nullptr;
};

/// Counts the triangles [begin, end) for this round.
CellCounts count_cells(const io::TriangleSource& source, const PointRule& rule,
                       const PartitionBuilder& builder, uint64_t begin, uint64_t end,
                       const CellPass& pass = {});

/// All rounds over a whole source.
Partition build_partition(const io::TriangleSource& source, const PointRule& rule, const Aabb& box,
                          const PartitionConfig& config, SourceMeasure* measure = nullptr);

}  // namespace umbel::scale
