// Most edges of a mesh in clusters are manifold, and one cluster shows it: all triangles around
// most vertices are in one cluster. Only what is left is gathered from all of them.
#include "lod/dag/cluster_topology.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "base/parallel.hpp"
#include "lod/dag/topology.hpp"

namespace umbel::lod {
namespace {

// Neighbours of a vertex of a cluster.
using Neighbours = std::array<uint64_t, 4>;

// Whether it was there.
bool insert(Neighbours& set, uint8_t vertex) {
  uint64_t& word = set[vertex >> 6];
  const uint64_t bit = uint64_t{1} << (vertex & 63);
  const bool is_known = (word & bit) != 0;
  word |= bit;
  return is_known;
}

// Finds the edges of clusters that one cluster alone does not show to be manifold.
class DoubtfulEdges {
 public:
  DoubtfulEdges(const ClusterSet& clusters, std::span<const uint32_t> position_ids,
                std::span<const uint32_t> frozen)
      : clusters_(clusters), ids_(position_ids), uses_(position_ids.size(), 0) {
    for (uint32_t v : clusters.vertices) {
      uint8_t& uses = uses_[ids_[v]];
      uses = static_cast<uint8_t>(std::min(uses + 1, 2));
      has_wedges_ |= ids_[v] != v;
    }
    for (uint32_t p : frozen) uses_[p] = 2;
  }

  /// Of a cluster, as directed pairs of positions. Returns how many triangles are degenerate.
  size_t list(size_t cluster, std::vector<PositionPair>& edges) const {
    const auto vertices = clusters_.cluster_vertices(cluster);
    const auto corners = clusters_.cluster_corners(cluster);
    const auto number = numbers(vertices);
    std::array<Neighbours, 256> next, prev;
    std::array<bool, 256> is_manifold;
    std::fill_n(next.begin(), vertices.size(), Neighbours{});
    std::fill_n(prev.begin(), vertices.size(), Neighbours{});
    for (size_t i = 0; i < vertices.size(); ++i) is_manifold[i] = uses_[ids_[vertices[i]]] == 1;
    size_t degenerate = 0;
    for_each_triangle(corners, number, degenerate, [&](const std::array<uint8_t, 3>& t) {
      for (size_t k = 0; k < 3; ++k) {
        is_manifold[t[k]] &= !insert(next[t[k]], t[(k + 1) % 3]);
        insert(prev[t[k]], t[(k + 2) % 3]);
      }
    });
    // Where every neighbour comes next once and before once, all edges of the vertex are manifold,
    // if all that are at its position are here.
    for (size_t i = 0; i < vertices.size(); ++i) is_manifold[i] &= next[i] == prev[i];
    degenerate = 0;
    for_each_triangle(corners, number, degenerate, [&](const std::array<uint8_t, 3>& t) {
      for (size_t k = 0; k < 3; ++k) {
        const uint8_t a = t[k], b = t[(k + 1) % 3];
        if (!is_manifold[a] && !is_manifold[b])
          edges.push_back({ids_[vertices[a]], ids_[vertices[b]]});
      }
    });
    return degenerate;
  }

 private:
  // Vertices of a cluster by the first of them at the same position.
  std::array<uint8_t, 256> numbers(std::span<const uint32_t> vertices) const {
    std::array<uint8_t, 256> number;
    std::iota(number.begin(), number.end(), uint8_t{0});
    if (!has_wedges_) return number;
    // Open addressing: the first vertex of a position, one higher.
    constexpr uint32_t kSlots = 1024;
    std::array<uint16_t, kSlots> slots{};
    for (size_t i = 0; i < vertices.size(); ++i) {
      const uint32_t id = ids_[vertices[i]];
      if (uses_[id] < 2) continue;
      uint32_t slot = (id * 0x9e3779b1u) >> 22;
      while (slots[slot] != 0 && ids_[vertices[slots[slot] - 1]] != id) slot = (slot + 1) % kSlots;
      if (slots[slot] == 0) slots[slot] = static_cast<uint16_t>(i + 1);
      number[i] = static_cast<uint8_t>(slots[slot] - 1);
    }
    return number;
  }

  template <typename Visit>
  static void for_each_triangle(std::span<const uint8_t> corners,
                                const std::array<uint8_t, 256>& number, size_t& degenerate,
                                const Visit& visit) {
    for (size_t i = 0; i < corners.size(); i += 3) {
      const std::array t{number[corners[i]], number[corners[i + 1]], number[corners[i + 2]]};
      if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
        ++degenerate;
      else
        visit(t);
    }
  }

  const ClusterSet& clusters_;
  std::span<const uint32_t> ids_;
  bool has_wedges_ = false;    // several vertices at some position
  std::vector<uint8_t> uses_;  // of positions, by vertices of clusters: 0, 1, or 2 for more
};

// Takes the edges between two frozen positions out of `edges`.
std::vector<PositionPair> take_frozen(std::vector<PositionPair>& edges,
                                      std::span<const uint32_t> frozen, size_t count) {
  std::vector<uint8_t> is_frozen(count, 0);
  for (uint32_t p : frozen) is_frozen[p] = 1;
  const auto begin = std::stable_partition(
      edges.begin(), edges.end(),
      [&](const PositionPair& edge) { return !is_frozen[edge.first] || !is_frozen[edge.second]; });
  std::vector<PositionPair> taken(begin, edges.end());
  edges.erase(begin, edges.end());
  return taken;
}

}  // namespace

ClusterTopology cluster_topology(const ClusterSet& clusters, std::span<const uint32_t> position_ids,
                                 std::span<const uint32_t> frozen) {
  constexpr size_t kChunk = 256;
  struct Found {
    std::vector<PositionPair> edges;
    size_t degenerate = 0;
  };
  const DoubtfulEdges doubtful(clusters, position_ids, frozen);
  std::vector<Found> found((clusters.size() + kChunk - 1) / kChunk);
  parallel_chunks(clusters.size(), kChunk, [&](size_t begin, size_t end) {
    Found& of_chunk = found[begin / kChunk];
    for (size_t c = begin; c < end; ++c) of_chunk.degenerate += doubtful.list(c, of_chunk.edges);
  });
  ClusterTopology result;
  std::vector<PositionPair> edges;
  for (Found& of_chunk : found) {
    edges.insert(edges.end(), of_chunk.edges.begin(), of_chunk.edges.end());
    of_chunk.edges = {};
    result.degenerate_triangles += of_chunk.degenerate;
  }
  if (!frozen.empty()) result.undecided = take_frozen(edges, frozen, position_ids.size());
  result.non_manifold_components = non_manifold_components(edges, position_ids.size());
  return result;
}

}  // namespace umbel::lod
