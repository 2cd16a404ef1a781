// The geometry of all clusters as verification needs it: which edges, by position, each has.
#pragma once

#include <algorithm>
#include <span>

#include "base/hash.hpp"
#include "base/interner.hpp"
#include "base/progress.hpp"
#include "lod/verify/findings.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel::lod {

/// A triangle's side: an edge and the direction in which the triangle runs along it.
struct Side {
  uint32_t edge : 31;
  uint32_t backward : 1;
};

/// Vertices at exactly the same position (-0 equals 0) are one position, and an unordered pair of
/// positions is one edge, whatever the cluster. Triangles with two corners at one position have
/// no sides.
struct Topology {
  std::vector<Vec3> positions;
  std::vector<uint64_t> edges;         ///< lower position << 32 | higher
  std::vector<Side> sides;             ///< three a triangle, in the order of clusters and triangles
  std::vector<uint64_t> side_offsets;  ///< clusters + 1
  std::vector<uint32_t> cluster_positions;
  std::vector<uint64_t> position_offsets;  ///< clusters + 1
  /// Of each edge: whether its ends are joined by non-manifold edges of the source, those that are
  /// not shared by two triangles running in opposite directions, so that it need not be either.
  std::vector<uint8_t> allowed;
  bool oriented = true;  ///< no two triangles of the source run the same way along their edge
  bool complete = true;  ///< every cluster could be read

  std::span<const Side> sides_of(uint32_t cluster) const {
    return std::span(sides).subspan(side_offsets[cluster],
                                    side_offsets[cluster + 1] - side_offsets[cluster]);
  }
  std::span<const uint32_t> positions_of(uint32_t cluster) const {
    return std::span(cluster_positions)
        .subspan(position_offsets[cluster],
                 position_offsets[cluster + 1] - position_offsets[cluster]);
  }
  std::string edge_text(uint32_t edge) const {
    return "the edge from " + text(positions[edges[edge] >> 32]) + " to " +
           text(positions[edges[edge] & 0xffffffffu]);
  }
};

struct EdgeHash {
  uint64_t operator()(uint64_t edge) const { return mix64(edge); }
};

/// Numbers the positions and edges of clusters, one after the other.
class TopologyBuilder {
 public:
  TopologyBuilder() { topology_.side_offsets = topology_.position_offsets = {0}; }
  void reserve(uint64_t triangles) { topology_.sides.reserve(3 * triangles); }
  /// A cluster whose indices are in range.
  void add(const ClusterGeometry& cluster);
  /// All but `allowed`.
  Topology take();

 private:
  void add_triangle(uint32_t a, uint32_t b, uint32_t c);

  Topology topology_;
  Interner<Vec3, ValueHash> positions_;
  Interner<uint64_t, EdgeHash> edges_;
  std::vector<uint32_t> ids_;
};

/// Calls irregular(edge) for the edges of some clusters that are not shared by two of their
/// triangles in opposite directions, of those that `counts` says yes to. `clusters` are indices in
/// the topology.
template <typename Counts, typename Irregular>
void for_each_irregular(const Topology& topology, std::span<const uint32_t> clusters,
                        const Counts& counts, const Irregular& irregular) {
  std::vector<uint64_t> uses;
  for (const uint32_t c : clusters)
    for (const Side& side : topology.sides_of(c))
      if (counts(side.edge)) uses.push_back(uint64_t{side.edge} << 1 | side.backward);
  std::sort(uses.begin(), uses.end());
  for (auto at = uses.begin(); at != uses.end();) {
    const auto end = std::upper_bound(at, uses.end(), *at | 1);
    if (end - at != 2 || *at == *(at + 1)) irregular(static_cast<uint32_t>(*at >> 1));
    at = end;
  }
}

/// Reads every cluster once, checking it against the limits, its box and its group's sphere, and
/// compares those that nothing generated with the source.
Topology read_topology(const Tables& tables, const GeometryReader& geometry,
                       const VerifyConfig& config, Findings& findings, Progress& progress);

}  // namespace umbel::lod
