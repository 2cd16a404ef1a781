// The section CREF: what the pages of coarse groups say of refining them, so that a walk need not
// read those pages on its way down. docs/format.md has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/file/format.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

/// Files of so many pages get the table.
inline constexpr uint64_t kLeastCoarsePages = 1024;
inline constexpr uint32_t kCoarseBytes = 40;

/// The first of a mesh's groups that the writer puts into the table: all from there on.
uint32_t first_coarse(const FileHeader& header, const MeshEntry& mesh);

/// By a group's clusters and its references.
Refinement refinement_of(std::span<const lod::Cluster> clusters,
                         std::span<const GroupRef> children);

/// Throws kCorrupt if the table, where it knows the group, and the group's page disagree.
void check_coarse(const Refinement* known, const PageGroup& group);

/// Of a mesh.
struct CoarseGroups {
  uint32_t first = 0;
  std::vector<Refinement> groups;  ///< from the first on
};

/// To write: for each mesh its first group, then that and all behind it.
void append_first(uint32_t group, std::vector<std::byte>& table);
void append_coarse(const GroupRef& group, const Refinement& refinement,
                   std::vector<std::byte>& table);
/// Throws kCorrupt for groups or pages that are not there.
std::vector<CoarseGroups> decode_coarse(std::span<const std::byte> table, const FileHeader& header);

}  // namespace umbel::asset
