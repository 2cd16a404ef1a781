// What all tasks of a tier must know, and what a unit says of itself once it is built.
#pragma once

#include <cstdint>
#include <vector>

#include "io/source/triangle_source.hpp"
#include "scale/exits.hpp"
#include "scale/point_rule.hpp"
#include "scale/unit_task.hpp"

namespace umbel::scale {

/// Triangles of a leaf that several units share, in all sorted files before one.
struct SharedBefore {
  uint32_t shard, leaf;
  uint64_t triangles;
};

/// What is one value is an array of one.
struct TierPlan {
  std::vector<TierConfig> tier;
  std::vector<uint32_t> first_serial, shards;
  std::vector<uint64_t> capacity;  ///< that the partition was made with
  std::vector<PointRule> rule;
  std::vector<std::byte> partition;
  std::vector<PositionEdge> non_manifold;
  std::vector<SharedBefore> shared;
  std::vector<uint8_t> streams;  ///< normals, tangents, uvs, colours, materials
  std::vector<Extra> extras;
};

template <typename Visit>
void for_each_array(TierPlan& plan, Visit& visit) {
  visit(plan.tier), visit(plan.first_serial), visit(plan.shards), visit(plan.capacity);
  visit(plan.rule), visit(plan.partition), visit(plan.non_manifold), visit(plan.shared);
  visit(plan.streams), visit(plan.extras);
}

inline io::SourceStreams streams_of(const TierPlan& plan) {
  const auto& s = plan.streams;
  return {s[0] != 0, s[1] != 0, s[2] != 0, s[3] != 0, s[4] != 0, plan.extras};
}

/// Of a unit that is built, beside its parts and exits.
struct UnitSummary {
  std::vector<uint32_t> next_level;
  std::vector<uint64_t> triangles;  ///< of the exits
  std::vector<uint64_t> undecided;  ///< edges
  std::vector<lod::Report> report;
};

template <typename Visit>
void for_each_array(UnitSummary& summary, Visit& visit) {
  visit(summary.next_level), visit(summary.triangles), visit(summary.undecided);
  visit(summary.report);
}

/// Of exits, what the next tier is planned by: some thousandth of their bytes.
struct ExitSummary {
  std::vector<Vec3> middles;            ///< of clusters
  std::vector<uint32_t> triangles;      ///< of each
  std::vector<PositionEdge> undecided;  ///< see Exits
  std::vector<Vec3> new_positions;      ///< see Exits
};

template <typename Visit>
void for_each_array(ExitSummary& summary, Visit& visit) {
  visit(summary.middles), visit(summary.triangles), visit(summary.undecided);
  visit(summary.new_positions);
}

}  // namespace umbel::scale
