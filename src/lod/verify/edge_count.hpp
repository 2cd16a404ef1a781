// How many triangles of a set of clusters share each edge.
#pragma once

#include "lod/verify/verify_geometry.hpp"

namespace umbel::lod {

/// An edge that neither two triangles share nor the source allows.
struct BadEdge {
  uint32_t edge, triangles, cluster;
};

/// Counts over a flat array of all edges, in time linear in the set. Reusable.
class EdgeCount {
 public:
  explicit EdgeCount(const Topology& topology)
      : topology_(topology), counts_(topology.edges.size(), 0) {}

  /// Calls bad(BadEdge) for each bad edge once, in the order of the clusters.
  template <typename Bad>
  void count(std::span<const uint32_t> clusters, const Bad& bad) {
    for_each_side(clusters, [&](uint32_t edge, uint32_t) { counts_[edge] += counts_[edge] < 255; });
    for_each_side(clusters, [&](uint32_t edge, uint32_t cluster) {
      const uint8_t triangles = counts_[edge];
      if (triangles == 2 || topology_.allowed[edge]) return;
      counts_[edge] = 2;
      bad(BadEdge{edge, triangles, cluster});
    });
    for_each_side(clusters, [&](uint32_t edge, uint32_t) { counts_[edge] = 0; });
  }

 private:
  template <typename Visit>
  void for_each_side(std::span<const uint32_t> clusters, const Visit& visit) const {
    for (const uint32_t c : clusters)
      for (const Side& side : topology_.sides_of(c)) visit(side.edge, c);
  }

  const Topology& topology_;
  std::vector<uint8_t> counts_;  ///< 255 stands for more as well
};

}  // namespace umbel::lod
