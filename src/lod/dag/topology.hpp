// Which edges of a mesh are non-manifold, by position, and whether a simplified sub-mesh has new
// ones.
//
// An edge is manifold if exactly two triangles share it and run along it in opposite directions.
// All others are called non-manifold here: boundaries, three triangles at an edge, and surfaces
// that are not consistently oriented. Where the source has such edges, edges between positions that
// they connect are *allowed* to be so in every cut.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/hash_index.hpp"
#include "umbel/types.hpp"

namespace umbel::lod {

using PositionPair = std::pair<uint32_t, uint32_t>;

/// The same for both directions of an edge.
inline uint64_t edge_key(const PositionPair& edge) {
  return uint64_t{std::min(edge.first, edge.second)} << 32 | std::max(edge.first, edge.second);
}

/// For each position (index of `position_ids`) the component of the graph of non-manifold edges, or
/// kNone for a position that touches none. Degenerate triangles (two corners at one position) are
/// left out.
std::vector<uint32_t> non_manifold_components(std::span<const Triangle> triangles,
                                              std::span<const uint32_t> position_ids);

/// The same from the directed edges of all triangles, or at least all edges of those that share
/// one that may be non-manifold; `count` positions.
std::vector<uint32_t> non_manifold_components(std::span<const PositionPair> edges, size_t count);

/// Of locked positions: the caller holds them, and the open edges between two such.
inline constexpr uint8_t kHeld = 2;

/// Compares a sub-mesh of a surface before and after simplification. Edge collapse is a simplicial
/// map, so it keeps the boundary of the sub-mesh modulo 2; what it may do wrong is to close a loop
/// of three edges that bounds no triangle, after which four triangles share an edge (the link
/// condition of Dey et al. 1999), and to make a new edge between two locked vertices, where a
/// neighbouring sub-mesh may have or make one too (locked_edges.hpp). Reusable; not thread-safe.
class SubMeshTopology {
 public:
  /// Positions of the sub-mesh are numbered 0..; `locked[p]` is not 0 where a neighbour has p too,
  /// and kHeld where the caller holds it; `component[p]` is that of non_manifold_components.
  void set_sub_mesh(std::span<const Triangle> triangles, std::span<const uint8_t> locked,
                    std::span<const uint32_t> component);

  /// The edges of `result` that neither the rule of two triangles nor the source allows, in a
  /// fixed order. Empty: the result can take the sub-mesh's place in every cut, provided that
  /// nobody else has its new edges between locked vertices. Those that `may_add(a, b)` says are
  /// legal are collected, others count as violations. With `by_direction` so do edges that
  /// triangles run along otherwise than those of the sub-mesh: collapses keep directions.
  template <typename MayAdd>
  std::span<const PositionPair> violations(std::span<const Triangle> result, const MayAdd& may_add,
                                           bool by_direction = false) {
    count_edges(result, by_direction);
    std::erase_if(locked_edges_, [&](const PositionPair& edge) {
      if (may_add(edge.first, edge.second)) return false;
      violations_.push_back(edge);
      return true;
    });
    return violations_;
  }

  /// New edges between locked vertices of the last result.
  std::span<const PositionPair> locked_edges() const { return locked_edges_; }
  /// The edges of the sub-mesh itself between two locked vertices, each as often as a triangle has
  /// it.
  std::span<const PositionPair> own_locked_edges() const { return own_locked_edges_; }

 private:
  struct Entry {
    PositionPair edge;
    uint32_t before, after;  // triangles
    int32_t net;             // of those after that run from the first to the second, less before
  };
  Entry& entry(uint32_t a, uint32_t b);
  void count_edges(std::span<const Triangle> result, bool by_direction);

  HashIndex index_;
  std::vector<Entry> entries_;
  std::vector<PositionPair> own_locked_edges_;
  std::span<const uint8_t> locked_;
  std::span<const uint32_t> component_;
  std::vector<PositionPair> violations_, locked_edges_;
};

}  // namespace umbel::lod
