// Puts slices together into one unit. Vertices, positions, labels and edges of slices meet here by
// value alone.
#pragma once

#include <cstdint>
#include <vector>

#include "base/interner.hpp"
#include "lod/build/unit.hpp"
#include "mesh/vertex_bits.hpp"
#include "scale/exits.hpp"
#include "scale/partition.hpp"
#include "scale/unit_task.hpp"
#include "scale/vertex_table.hpp"

namespace umbel::scale {

/// An edge of a LockedEdgeSet with one end that the unit does not have.
struct HalfKnownEdge {
  uint32_t position;  ///< id
  PositionEdge edge;
};

struct GatheredUnit {
  lod::Unit unit;
  std::vector<Generator> generators;  ///< of the unit's first clusters
  std::vector<HalfKnownEdge> half_known;
};

GatheredUnit gather_unit(std::vector<Slice> slices, const std::vector<PositionEdge>& non_manifold,
                         const Partition& partition, uint32_t unit, const TierConfig& tier);

}  // namespace umbel::scale
