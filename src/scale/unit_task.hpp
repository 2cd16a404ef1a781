// Builds one unit: some rounds over its part of the surface.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "lod/dag/unused_positions.hpp"
#include "scale/exits.hpp"
#include "scale/partition.hpp"
#include "scale/unit_input.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::scale {

/// What one unit of the tier before has for a unit.
struct Slice {
  Exits exits;
  /// Positions at home in the unit that clusters of other units of this tier have.
  std::vector<Vec3> mail;
};

template <typename Visit>
void for_each_array(Slice& slice, Visit& visit) {
  for_each_array(slice.exits, visit);
  visit(slice.mail);
}

/// What is the same for all units of a tier.
struct TierConfig {
  lod::Config config;
  Aabb box;               ///< around all triangles of the mesh
  uint32_t rounds = 2;    ///< levels that a tier makes
  uint32_t level = 0;     ///< of its first groups
  bool is_last = false;   ///< one unit, which goes on to the roots
  bool is_whole = false;  ///< it is the first tier as well
};

/// Where a unit writes, and what it may use.
struct UnitOutput {
  uint32_t serial;              ///< of all units of all tiers
  std::filesystem::path parts;  ///< the file of groups, which has its name once all are in it
  /// For components that are enlarged; null: none are.
  const lod::UnusedPositions* unused = nullptr;
};

struct BuiltUnit {
  Exits exits;
  uint32_t next_level = 0;  ///< above all of its groups
  lod::Report report;
};

/// A unit of the first tier.
BuiltUnit build_unit(UnitInput input, const TierConfig& tier, const UnitOutput& output);

/// A unit of a later tier, from the slices of all units of the tier before in their order.
/// `non_manifold`: edges between once frozen positions that the first tier could not decide and
/// that are not manifold.
BuiltUnit build_unit(std::vector<Slice> slices, const std::vector<PositionEdge>& non_manifold,
                     const Partition& partition, uint32_t unit, const TierConfig& tier,
                     const UnitOutput& output);

}  // namespace umbel::scale
