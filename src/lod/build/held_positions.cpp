#include "lod/build/held_positions.hpp"

#include <algorithm>

#include "base/interner.hpp"
#include "base/radix_sort.hpp"
#include "lod/dag/topology.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel::lod {
namespace {

void append_locked(const Source& source, std::span<const Vec3> locked,
                   std::vector<uint32_t>& held) {
  if (locked.empty()) return;
  Interner<Vec3, ValueHash> set;
  for (const Vec3& p : locked) set.insert(without_negative_zero(p));
  for (uint32_t v = 0; v < source.position_ids.size(); ++v)
    if (source.position_ids[v] == v && set.contains(source.mesh.positions[v])) held.push_back(v);
}

void append_ends_of_open_edges(const Source& source, const ClusterSet& finest,
                               std::vector<uint32_t>& held) {
  std::vector<uint64_t> edges;
  edges.reserve(3 * finest.triangle_count());
  for (uint32_t c = 0; c < finest.size(); ++c) {
    const auto vertices = finest.cluster_vertices(c);
    const auto corners = finest.cluster_corners(c);
    const auto position = [&](size_t i) { return source.position_ids[vertices[corners[i]]]; };
    for (size_t i = 0; i < corners.size(); i += 3) {
      const uint32_t a = position(i), b = position(i + 1), d = position(i + 2);
      if (a == b || b == d || d == a) continue;
      edges.insert(edges.end(), {edge_key({a, b}), edge_key({b, d}), edge_key({d, a})});
    }
  }
  std::vector<uint64_t> spare(edges.size());
  if (radix_sort(edges.data(), spare.data(), edges.size(), 0, 64) != edges.data())
    edges.swap(spare);
  for (size_t i = 0, next = 0; i < edges.size(); i = next) {
    for (next = i + 1; next < edges.size() && edges[next] == edges[i];) ++next;
    if (next != i + 1) continue;
    held.push_back(static_cast<uint32_t>(edges[i] >> 32));
    held.push_back(static_cast<uint32_t>(edges[i]));
  }
}

}  // namespace

std::vector<uint32_t> held_positions(const Source& source, const ClusterSet& finest,
                                     std::span<const Vec3> locked, bool borders) {
  std::vector<uint32_t> held;
  append_locked(source, locked, held);
  if (borders) append_ends_of_open_edges(source, finest, held);
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  return held;
}

}  // namespace umbel::lod
