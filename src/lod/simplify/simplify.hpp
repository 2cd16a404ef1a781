// Simplifies one group of clusters to fewer triangles with its border held fixed.
//
// A fallback chain of methods (SimplifyMethod): edge collapse that keeps attribute seams
// (collapse_methods.hpp); meshoptimizer's edge collapse across them (meshopt_methods.hpp); removal
// of small connected components; merging of vertices by grid cell. Each result is checked edge by
// edge (candidate_check.hpp), so that it fits its neighbours in every cut.
#pragma once

#include <cstdint>
#include <span>

#include "lod/simplify/candidate.hpp"
#include "lod/simplify/candidate_check.hpp"
#include "lod/simplify/collapse_methods.hpp"
#include "lod/simplify/group_components.hpp"
#include "lod/simplify/group_mesh.hpp"
#include "lod/simplify/meshopt_methods.hpp"
#include "lod/simplify/patches.hpp"

namespace umbel::lod {

/// Keeps its scratch memory from group to group; one a thread.
class GroupSimplifier {
 public:
  GroupSimplifier(const Source& source, const Config& config, const Decimator& decimate)
      : decimate_(decimate), group_(source, config) {}
  GroupSimplifier(const GroupSimplifier&) = delete;
  GroupSimplifier& operator=(const GroupSimplifier&) = delete;

  /// `locked` is by position id.
  Simplified simplify(const ClusterSet& set, std::span<const uint32_t> clusters,
                      std::span<const uint8_t> locked, const Allowance& allow);

 private:
  using PatchChange = float (*)(const PatchInput&, size_t, std::vector<Triangle>&);

  LimitingFactor try_methods(size_t target, size_t good, Candidate& best);
  Candidate replace_patches(const Candidate& from, size_t target, PatchChange change);
  SubMesh sub_mesh_of(const Candidate& candidate, const AddedVertices& added) const;

  const Decimator& decimate_;
  GroupMesh group_;
  GroupComponents components_{group_};
  CandidateCheck check_{group_};
  CollapseMethods collapse_{group_, components_, check_};
  MeshoptMethods meshopt_{group_, components_, check_};
};

}  // namespace umbel::lod
