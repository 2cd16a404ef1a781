// The simplification methods that collapse edges by quadrics (collapse/collapse.hpp).
#pragma once

#include <vector>

#include "lod/simplify/candidate.hpp"
#include "lod/simplify/candidate_check.hpp"
#include "lod/simplify/collapse/collapse.hpp"
#include "lod/simplify/group_components.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

class CollapseMethods {
 public:
  CollapseMethods(GroupMesh& group, GroupComponents& components, CandidateCheck& check)
      : group_(group), components_(components), check_(check) {}

  /// Keeps the surface manifold, and seams by their rules. Where that fails or the error is large,
  /// small connected components may be removed too (SimplifyMethod::kPrune). Always valid.
  /// Collapses whose cost rises steeply are left out where more than `good` triangles are not.
  Candidate regular(size_t target, size_t good);
  /// Moves manifold vertices as non-manifold ones, across seams.
  Candidate non_manifold(size_t target, bool allow_flips);

  /// What the last of them stopped at.
  LimitingFactor limiting_factor() const { return collapser_.limiting_factor(); }
  /// Whether the last of them may have left no triangle of a component.
  bool may_lose_components() const { return collapser_.has_moved_non_manifold(); }
  /// Whether it went on, for want of others, with collapses that cost far more than the first.
  bool was_forced() const { return collapser_.was_forced(); }
  double area() const { return collapser_.area(); }  ///< of the group

 private:
  CollapseInput input();
  void find_seam_rules();
  void run_with_removal(const CollapseInput& input, size_t target);
  Candidate result() const;
  void refit_attributes(Candidate& candidate) const;

  GroupMesh& group_;
  GroupComponents& components_;
  CandidateCheck& check_;
  EdgeCollapser collapser_;
  std::vector<uint32_t> materials_;  // of vertices; empty: one
  std::vector<SeamRule> rules_;      // of positions; empty: allowed everywhere
};

}  // namespace umbel::lod
