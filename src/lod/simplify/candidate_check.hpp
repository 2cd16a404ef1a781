// Whether a candidate fits its group's neighbours in every cut, edge by edge (topology.hpp).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/topology.hpp"
#include "lod/simplify/candidate.hpp"
#include "lod/simplify/group_components.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

class CandidateCheck {
 public:
  explicit CandidateCheck(GroupMesh& group) : group_(group) {}

  /// Whenever another group has been gathered, or vertices have been appended.
  void reset(const Allowance& allow);
  const Allowance& allowance() const { return allow_; }

  /// Whether the group shares no position with others, and may get new ones.
  bool is_alone() const;

  /// Edges that no neighbour expects, as pairs of positions. Valid until the next call.
  /// `by_direction`: see SubMeshTopology::violations.
  std::span<const PositionPair> faults(std::span<const Triangle> triangles,
                                       bool by_direction = false);
  /// Repairs what it can of the faults; returns those that are left.
  std::span<const PositionPair> repair(const GroupComponents& components, Candidate& candidate);
  /// Makes the candidate valid if it mixes no materials and has no fault.
  void accept_if_sound(Candidate& candidate);
  /// Makes the candidate valid, in which no fault was found last.
  void accept(Candidate& candidate) const;

 private:
  void find_spare_vertices();

  GroupMesh& group_;
  Allowance allow_;
  SubMeshTopology topology_;
  bool knows_topology_ = false, knows_spare_ = false;
  std::vector<uint8_t> spare_;  // of vertices: repair may bring them back
  std::vector<Triangle> result_positions_;
};

}  // namespace umbel::lod
