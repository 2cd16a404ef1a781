// What tests ask of a mesh's edges.
#pragma once

#include <map>
#include <utility>

#include "umbel/mesh.hpp"

namespace umbel::testing {

/// How often each directed edge occurs.
inline std::map<std::pair<uint32_t, uint32_t>, int> directed_edges(const MeshView& mesh) {
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  return edges;
}

/// Undirected edges that exactly one triangle has.
inline size_t border_edges(const MeshView& mesh) {
  const auto edges = directed_edges(mesh);
  size_t open = 0;
  for (const auto& [edge, count] : edges)
    open += count == 1 && !edges.contains({edge.second, edge.first});
  return open;
}

/// Every edge is shared by exactly two triangles that run along it in opposite directions.
inline bool is_closed_and_oriented(const MeshView& mesh) {
  const auto edges = directed_edges(mesh);
  for (const auto& [edge, count] : edges)
    if (count != 1 || !edges.contains({edge.second, edge.first})) return false;
  return true;
}

}  // namespace umbel::testing
