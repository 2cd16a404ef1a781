// The tables of an asset's groups, without those of its clusters, which take ten times as much.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

/// Of one mesh.
struct GroupTables {
  lod::Tables tables;             ///< no clusters
  std::vector<uint32_t> pages;    ///< of each group
  std::vector<bool> has_source;   ///< whether some of its clusters were made from no group
  uint64_t source_triangles = 0;  ///< of such clusters
  /// The groups that have clusters made from group g: parents[parent_offsets[g]] and on.
  std::vector<uint32_t> parent_offsets, parents;

  std::span<const uint32_t> parents_of(uint32_t group) const {
    return std::span(parents).subspan(parent_offsets[group],
                                      parent_offsets[group + 1] - parent_offsets[group]);
  }
};

/// What they take of an asset, about.
uint64_t group_table_bytes(const Asset& asset);

/// Reads every page once, some at a time. Pages that cannot be read or used go to `broken`, with a
/// sentence each; if there are any, the tables are not whole. Throws kCorrupt if pages do not fit
/// together.
std::vector<GroupTables> read_group_tables(const Asset& asset, Progress& progress, double share,
                                           std::vector<std::string>& broken);

}  // namespace umbel::asset
