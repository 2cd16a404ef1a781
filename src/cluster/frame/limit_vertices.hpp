// Vertices of clusters, for any executor: splits clusters that use too many, and lists the vertices
// of each. A team a cluster, with a small hash table that tells vertices apart.
#pragma once

#include <cstdint>

#include "base/exec.hpp"
#include "base/team.hpp"
#include "cluster/frame/frame_mesh.hpp"

namespace umbel::cluster {

/// The distinct vertices of a cluster: a hash table that the lanes of a team fill together. Where a
/// vertex lies in it depends on who came first; its first corner does not.
struct TeamVertexTable {
  static constexpr uint32_t kMost = 256;  ///< vertices of a cluster
  static constexpr uint32_t kSlots = 2 * kMost;
  static constexpr uint32_t kFree = 0xffffffffu;

  uint32_t vertices[kSlots];
  uint32_t corners[kSlots];  ///< the first corner at the vertex

  template <typename Team>
  UMBEL_HOST_DEVICE void clear(const Team& team) {
    for (uint32_t slot = team.rank(); slot < kSlots; slot += team.size())
      vertices[slot] = corners[slot] = kFree;
  }
  template <typename Team>
  UMBEL_HOST_DEVICE uint32_t add(const Team& team, uint32_t vertex, uint32_t corner) {
    uint32_t slot = home_of(vertex);
    for (;; slot = (slot + 1) % kSlots) {
      const uint32_t old = team.claim(&vertices[slot], kFree, vertex);
      if (old == kFree || old == vertex) break;
    }
    team.lower(&corners[slot], corner);
    return slot;
  }
  /// Where a vertex lies that was added before the last sync().
  UMBEL_HOST_DEVICE uint32_t slot_of(uint32_t vertex) const {
    uint32_t slot = home_of(vertex);
    while (vertices[slot] != vertex) slot = (slot + 1) % kSlots;
    return slot;
  }

 private:
  UMBEL_HOST_DEVICE static uint32_t home_of(uint32_t vertex) {
    return (vertex * 2654435769u) >> 23;
  }
};

/// Flags where a cluster must be split: as many triangles as fit, then the next ones.
struct LimitVertices {
  static constexpr uint32_t kLanes = 32;
  struct Shared {
    TeamVertexTable table;
  };
  struct Smaller {
    UMBEL_HOST_DEVICE uint32_t operator()(uint32_t a, uint32_t b) const { return a < b ? a : b; }
  };
  FrameMesh mesh;
  const uint32_t* indices;
  const uint32_t* offsets;
  uint32_t max_vertices;
  uint8_t* first;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t c, Shared& shared) const {
    constexpr uint32_t kNone = 0xffffffffu;
    TeamVertexTable& table = shared.table;
    const uint32_t begin = offsets[c], end = offsets[c + 1];
    uint32_t vertices = 0;  // of the triangles of this part so far
    table.clear(team);
    team.sync();
    // A triangle a lane. At most 3 * 32 vertices more than a cluster's are in the table.
    for (uint32_t next = begin; next < end;) {
      const uint32_t i = next + team.rank(), corner = 3 * (i - begin);
      uint32_t slots[3] = {};
      if (i < end) {
        const Triangle& t = mesh.triangles[indices[i]];
        for (uint32_t k = 0; k < 3; ++k) slots[k] = table.add(team, t[k], corner + k);
      }
      team.sync();
      uint32_t with_this = vertices, with_all = vertices;
      for (uint32_t k = 0; k < 3; ++k) {
        const bool is_first = i < end && table.corners[slots[k]] == corner + k;
        with_this += team.rank_among(is_first) + (is_first ? 1 : 0);
        with_all += team.count(is_first);
      }
      const uint32_t split =
          team.reduce(i < end && with_this > max_vertices ? i : kNone, Smaller{});
      if (split == kNone) {
        vertices = with_all;
        next += team.size();
        continue;
      }
      if (team.rank() == 0) first[split] = 1;
      table.clear(team);
      team.sync();
      vertices = 0;
      next = split;
    }
  }
};

/// Flags where clusters of the triangles at `indices` must begin.
template <typename Exec>
void limit_vertices(Exec& exec, const FrameMesh& mesh, const uint32_t* indices,
                    const uint32_t* offsets, const uint32_t* count, uint32_t most_clusters,
                    uint32_t max_vertices, uint8_t* first) {
  exec.for_each_team_of(count, most_clusters,
                        LimitVertices{mesh, indices, offsets, max_vertices, first});
}

/// Clusters' own vertices: cluster c has vertices[offsets[c] .. offsets[c + 1]), and triangle i of
/// the clusters the corners[i] among them.
struct LocalLists {
  uint32_t* offsets;
  uint32_t* vertices;
  uint8_t* corners;  ///< three a triangle
};

/// Numbers a cluster's vertices as they come, and counts them.
struct NumberVertices {
  static constexpr uint32_t kLanes = 32;
  struct Shared {
    TeamVertexTable table;
    uint8_t numbers[TeamVertexTable::kSlots];
  };
  FrameClusters clusters;
  uint8_t* corners;
  uint32_t* sizes;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t c, Shared& shared) const {
    TeamVertexTable& table = shared.table;
    const Triangle* triangles = clusters.triangles + clusters.offsets[c];
    uint8_t* numbers = corners + size_t(clusters.offsets[c]) * 3;
    const uint32_t count = 3 * (clusters.offsets[c + 1] - clusters.offsets[c]);
    table.clear(team);
    team.sync();
    for (uint32_t j = team.rank(); j < count; j += team.size())
      table.add(team, triangles[j / 3][j % 3], j);
    team.sync();
    uint32_t size = 0;
    for (uint32_t begin = 0; begin < count; begin += team.size()) {
      const uint32_t j = begin + team.rank();
      const uint32_t slot = j < count ? table.slot_of(triangles[j / 3][j % 3]) : 0;
      const bool is_first = j < count && table.corners[slot] == j;
      const uint32_t number = size + team.rank_among(is_first);
      if (is_first) shared.numbers[slot] = uint8_t(number);
      size += team.count(is_first);
    }
    team.sync();
    for (uint32_t j = team.rank(); j < count; j += team.size())
      numbers[j] = shared.numbers[table.slot_of(triangles[j / 3][j % 3])];
    if (team.rank() == 0) sizes[c] = size;
  }
};

/// Writes the vertices that have these numbers.
struct WriteVertices {
  static constexpr uint32_t kLanes = 32;
  struct Shared {
    uint32_t corners[TeamVertexTable::kMost];  ///< the first one of each vertex
  };
  FrameClusters clusters;
  LocalLists lists;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t c, Shared& shared) const {
    const Triangle* triangles = clusters.triangles + clusters.offsets[c];
    const uint8_t* numbers = lists.corners + size_t(clusters.offsets[c]) * 3;
    const uint32_t count = 3 * (clusters.offsets[c + 1] - clusters.offsets[c]);
    const uint32_t size = lists.offsets[c + 1] - lists.offsets[c];
    for (uint32_t v = team.rank(); v < size; v += team.size()) shared.corners[v] = count;
    team.sync();
    for (uint32_t j = team.rank(); j < count; j += team.size())
      team.lower(&shared.corners[numbers[j]], j);
    team.sync();
    for (uint32_t v = team.rank(); v < size; v += team.size()) {
      const uint32_t j = shared.corners[v];
      lists.vertices[lists.offsets[c] + v] = triangles[j / 3][j % 3];
    }
  }
};

/// No cluster may have more than TeamVertexTable::kMost vertices.
template <typename Exec>
void list_vertices(Exec& exec, const FrameClusters& clusters, uint32_t most_clusters,
                   const LocalLists& out) {
  // Not within the scan, which few of a device's blocks do.
  exec.for_each_team_of(clusters.count, most_clusters,
                        NumberVertices{clusters, out.corners, out.offsets});
  exec.exclusive_scan(
      most_clusters,
      [offsets = out.offsets, count = clusters.count] UMBEL_DEVICE_LAMBDA(size_t c) {
        return c < *count ? offsets[c] : 0;
      },
      out.offsets);
  exec.for_each_team_of(clusters.count, most_clusters, WriteVertices{clusters, out});
}

}  // namespace umbel::cluster
