// What an edge collapse is given: a part of a surface, and what may be done to it.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "lod/dag/locked_edges.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// Vertices and positions are numbered from 0. Several vertices may be at one position; no triangle
/// has two corners at one.
struct CollapseInput {
  std::span<const Triangle> triangles;       ///< of vertices
  std::span<const uint32_t> position_of;     ///< of vertices
  std::span<const Vec3> positions;           ///< of vertices
  std::span<const float> attributes;         ///< attribute_weights.size() a vertex, 32 at most
  std::span<const float> attribute_weights;  ///< a difference of 1 counts as this part of the root
                                             ///< of the area that has it
  std::span<const uint8_t> locked;           ///< of positions: stays where it is
  std::span<const uint32_t> non_manifold_component;  ///< of positions, see topology.hpp
  bool allow_locked_edges = true;               ///< new edges between locked positions are legal
  const LockedEdgeSet* taken = nullptr;         ///< except for these
  std::span<const uint32_t> position_ids = {};  ///< of positions, as in `taken`
  std::span<const uint32_t> materials = {};     ///< of vertices; empty: one
  std::span<const SeamRule> rules = {};         ///< of positions; empty: SeamRule::kAllow
  /// Non-manifold positions move too, within their component. The result must be checked.
  bool move_non_manifold = true;
  /// With fewer triangles than this, a collapse may cost little more than those before it.
  size_t limit_below = 0;
  /// And where that leaves more triangles than this, cost is unlimited down to this many.
  size_t unlimited_until = std::numeric_limits<size_t>::max();
  /// Before the first collapse with a larger error than this, or where nothing can go and more
  /// than `pause_until` triangles are left, the loop pauses.
  float pause_above = std::numeric_limits<float>::infinity();
  size_t pause_until = std::numeric_limits<size_t>::max();
  /// With fewer triangles than this, attributes may lose at most this part of the extent in one
  /// collapse, or little more than in those before it.
  size_t keep_attributes_below = 0;
  float attribute_loss = std::numeric_limits<float>::infinity();
  bool non_manifold_moves = false;  ///< manifold positions move as non-manifold ones do
  bool allow_flips = false;         ///< triangles may flip
};

}  // namespace umbel::lod
