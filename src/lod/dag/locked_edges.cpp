#include "lod/dag/locked_edges.hpp"

#include <algorithm>
#include <array>

namespace umbel::lod {
void LockedEdgeSet::insert(std::span<const PositionPair> edges) {
  constexpr size_t kAhead = 16;
  edges_.reserve(edges.size());
  for (size_t i = 0; i < edges.size(); ++i) {
    if (i + kAhead < edges.size()) edges_.prefetch(edge_key(edges[i + kAhead]));
    edges_.insert(edge_key(edges[i]));
  }
}

bool LockedEdgeSet::contains(const PositionPair& edge) const {
  return edges_.contains(edge_key(edge)) || (was_frozen(edge.first) && was_frozen(edge.second));
}

void LockedEdgeSet::freeze(std::span<const uint32_t> positions) {
  if (positions.empty()) return;
  const uint32_t highest = *std::max_element(positions.begin(), positions.end());
  if (was_frozen_.size() <= highest) was_frozen_.resize(size_t{highest} + 1, 0);
  for (const uint32_t p : positions) was_frozen_[p] = 1;
}

bool LockedEdgeSet::contains_any(std::span<const PositionPair> edges) const {
  return std::any_of(edges.begin(), edges.end(),
                     [&](const PositionPair& edge) { return contains(edge); });
}

std::vector<PositionPair> own_locked_edges(const ClusterSet& set,
                                           std::span<const uint32_t> clusters,
                                           std::span<const uint32_t> position_ids,
                                           std::span<const uint8_t> locked) {
  std::vector<PositionPair> edges;
  std::array<uint32_t, 256> ids;
  std::array<uint8_t, 256> is_locked;
  for (uint32_t c : clusters) {
    const auto vertices = set.cluster_vertices(c);
    uint32_t count = 0;
    for (size_t i = 0; i < vertices.size(); ++i) {
      ids[i] = position_ids[vertices[i]];
      count += is_locked[i] = locked[ids[i]];
    }
    if (count < 2) continue;
    const auto corners = set.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3) {
      if (is_locked[corners[i]] + is_locked[corners[i + 1]] + is_locked[corners[i + 2]] < 2)
        continue;
      for (size_t k = 0; k < 3; ++k) {
        const uint8_t a = corners[i + k], b = corners[i + (k + 1) % 3];
        if (is_locked[a] && is_locked[b]) edges.push_back({ids[a], ids[b]});
      }
    }
  }
  return edges;
}

}  // namespace umbel::lod
