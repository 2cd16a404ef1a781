// The simplification methods of meshoptimizer.
#pragma once

#include <cstdint>
#include <vector>

#include "lod/simplify/candidate.hpp"
#include "lod/simplify/candidate_check.hpp"
#include "lod/simplify/group_components.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

class MeshoptMethods {
 public:
  MeshoptMethods(GroupMesh& group, GroupComponents& components, CandidateCheck& check)
      : group_(group), components_(components), check_(check) {}

  /// Edge collapse across attribute seams. Where it leaves faults that cannot be repaired, it runs
  /// again with the vertices around them held. The components must be known.
  Candidate permissive(size_t target);
  /// Whether any topology will do: the group shares nothing with others, and is not many small
  /// components, which are enlarged where others of them go. The components must be known.
  bool may_be_unbound() const { return check_.is_alone() && components_.has_main(); }
  /// Edge collapse to any topology.
  Candidate unbound(size_t target);
  /// Vertices in one cell of a grid become one (Rossignac & Borrel 1993). The components must be
  /// known.
  Candidate merge_cells(size_t target);

 private:
  bool is_suitable() const;
  Candidate collapse(size_t target);
  void accept_unbound(Candidate& candidate) const;
  void hold_around(uint32_t position);

  GroupMesh& group_;
  GroupComponents& components_;
  CandidateCheck& check_;
  std::vector<uint8_t> flags_;  // meshoptimizer's, of vertices
  std::vector<uint8_t> held_;   // positions held for one more try
};

}  // namespace umbel::lod
