// Keeps two sub-meshes of the surface from having an edge between the same two positions.
//
// Simplification may make a new edge between two locked vertices. If another group has, or ever
// had, an edge between the same two, some cut may show both, and four triangles share an edge. That
// other edge then was an edge between two locked vertices of its group in some round up to now: in
// the earlier of the two rounds in which the two edges' groups are drawn, the two sides are in
// different groups and share both ends. So it is enough to remember those edges of all rounds,
// which are few, and to refuse a new one that is among them. Those that groups have before a round
// are known to all of them; only new ones that two groups make in the same round come to light
// later.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/interner.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/topology.hpp"

namespace umbel::lod {

/// A set of edges, as unordered pairs of position ids.
class LockedEdgeSet {
 public:
  void insert(std::span<const PositionPair> edges);
  bool contains(const PositionPair& edge) const;
  bool contains_any(std::span<const PositionPair> edges) const;

  /// From now on it contains every edge between two of all positions that were given here: others
  /// may have edges between them that nobody here has heard of.
  void freeze(std::span<const uint32_t> positions);
  bool was_frozen(uint32_t position) const {
    return position < was_frozen_.size() && was_frozen_[position] != 0;
  }

  /// Calls visit(PositionPair) for each edge that was inserted, in that order.
  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (const uint64_t key : edges_.keys())
      visit(PositionPair{static_cast<uint32_t>(key >> 32), static_cast<uint32_t>(key)});
  }

 private:
  Interner<uint64_t, IntegerHash> edges_;
  std::vector<uint8_t> was_frozen_;  // by position id, as far as any was
};

/// The edges of a group of clusters between two locked positions, once for each triangle.
std::vector<PositionPair> own_locked_edges(const ClusterSet& set,
                                           std::span<const uint32_t> clusters,
                                           std::span<const uint32_t> position_ids,
                                           std::span<const uint8_t> locked);

}  // namespace umbel::lod
