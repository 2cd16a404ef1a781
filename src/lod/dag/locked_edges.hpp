// Keeps two sub-meshes of the surface from having an edge between the same two positions.
//
// A chord is an edge that simplification laid between two locked vertices. If another group has, or
// ever had, an edge between the same two, some cut may show both, and four triangles share an edge.
// That other edge then was an edge between two locked vertices of its group in some round up to
// now: in the earlier of the two rounds in which the two edges' groups are drawn, the two sides are
// in different groups and share both ends. So it is enough to remember those edges of all rounds,
// which are few, and to refuse a chord that is among them. Those that groups have before a round
// are known to all of them; only chords that two groups lay in the same one come to light later.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/big_vector.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/topology.hpp"

namespace umbel::lod {

/// A set of edges, as unordered pairs of position ids.
class LockedEdgeSet {
 public:
  void insert(std::span<const PositionPair> edges);
  bool contains(const PositionPair& edge) const;
  bool contains_any(std::span<const PositionPair> edges) const;

 private:
  size_t slot_of(uint64_t key) const;
  size_t first_slot(uint64_t key) const;
  void grow();

  BigVector<uint64_t> table_;  // open addressing
  size_t count_ = 0;
};

/// The edges of a group of clusters between two locked positions, several times maybe.
std::vector<PositionPair> own_locked_edges(const ClusterSet& set,
                                           std::span<const uint32_t> clusters,
                                           std::span<const uint32_t> position_ids,
                                           std::span<const uint8_t> locked);

}  // namespace umbel::lod
