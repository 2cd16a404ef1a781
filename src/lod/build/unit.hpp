// A part of the surface, or all of it, between two rounds of the build.
#pragma once

#include <cstdint>
#include <vector>

#include "lod/dag/cluster_set.hpp"
#include "lod/dag/locked_edges.hpp"
#include "lod/dag/source.hpp"
#include "lod/dag/unused_positions.hpp"
#include "umbel/types.hpp"

namespace umbel::lod {

/// All that groups depend on of those that generated their clusters.
struct GeneratingGroup {
  Sphere sphere;
  float error;
};

struct Unit {
  Source source;
  ClusterSet pending;  ///< clusters that wait for a group; generating_group: of `generators`
  std::vector<Sphere> spheres;  ///< of pending: generating groups', or their own
  /// Those of the clusters that the unit began with, then its own groups in their order.
  std::vector<GeneratingGroup> generators;
  LockedEdgeSet locked_edges;          ///< of all rounds
  std::vector<uint8_t> locked;         ///< by position id: borders of the last round; empty: none
  std::vector<uint32_t> frozen;        ///< position ids that other units may have: they stay
  std::vector<Vec3> locked_positions;  ///< that the caller has locked
  std::vector<uint32_t> held;          ///< position ids of those, and of borders that stay
  uint32_t level = 0;                  ///< of the next groups
  float moved = 0;                     ///< of positions before the build: part of every error
  bool is_whole = true;                ///< no other unit has a part of the surface, or ever had
  /// Of a unit that is not: where small components may be enlarged to; null: nowhere.
  const UnusedPositions* unused = nullptr;
  std::vector<Vec3> new_positions;  ///< where they were, if others must know
};

}  // namespace umbel::lod
