// A mesh while it is verified page by page, and the first reading of its geometry.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "asset/file/paged_tables.hpp"
#include "base/progress.hpp"
#include "lod/verify/findings.hpp"
#include "lod/verify/source_edges.hpp"

namespace umbel::asset {

inline constexpr uint32_t kPagesAtOnce = 8;

/// One mesh, as it is verified.
struct VerifiedMesh {
  uint32_t index;
  GroupTables& groups;
  lod::VerifyConfig config;
  lod::VerifyReport report;
  lod::Findings findings{report};
  lod::PositionHash hash;
  lod::JoinedPositions joined;
  bool links_hold = false, complete = true, oriented = true;
  uint64_t source_triangles = 0, source_digest = 0;

  VerifiedMesh(uint32_t mesh, GroupTables& tables, const lod::VerifyConfig& how)
      : index(mesh), groups(tables), config(how), hash(how.seed) {}

  lod::SimplifyMethod method(uint32_t group) const { return groups.tables.groups[group].method; }
};

/// The pages that have groups for which wanted(mesh, group) holds.
template <typename Wanted>
std::vector<bool> pages_with(const Asset& asset, const std::deque<VerifiedMesh>& meshes,
                             const Wanted& wanted) {
  std::vector<bool> has(asset.info().pages);
  for (const VerifiedMesh& mesh : meshes)
    for (uint32_t g = 0; g < mesh.groups.pages.size(); ++g)
      if (wanted(mesh, g)) has[mesh.groups.pages[g]] = true;
  return has;
}

/// Checks every cluster by itself, and finds of level 0 its triangles, their digest, and its
/// non-manifold edges, in about so many bytes.
void read_source(const Asset& asset, std::deque<VerifiedMesh>& meshes, uint64_t memory,
                 Progress& progress);

}  // namespace umbel::asset
