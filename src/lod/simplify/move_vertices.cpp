#include "lod/simplify/move_vertices.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/math.hpp"
#include "lod/dag/topology.hpp"

namespace umbel::lod {
namespace {

// Gives a vertex of the result a new position. `first_there` is the first new vertex there.
void move_vertex(const GroupMesh& group, uint32_t vertex, const Vec3& position,
                 uint32_t& first_there, Simplified& result) {
  AddedVertices& added = result.added;
  const uint32_t current = result.mesh.vertices[vertex];
  Mesh one;
  if (current < kAddedVertex)
    append_vertex(one, group.source.mesh, current);
  else
    append_vertex(one, added.mesh, current - kAddedVertex);
  one.positions[0] = position;
  append_vertex(added.mesh, one, 0);
  const uint32_t number = kAddedVertex + static_cast<uint32_t>(added.position_ids.size());
  added.position_ids.push_back(first_there);
  if (first_there == kNone) first_there = number;
  added.materials.push_back(group.material(vertex));
  result.mesh.vertices[vertex] = number;
  result.mesh.positions[vertex] = position;
}

// New positions that touch a non-manifold edge are in one component with those it connects.
void add_non_manifold_components(std::span<const Triangle> moved,
                                 std::span<const uint32_t> new_vertex_at, AddedVertices& added) {
  std::vector<uint32_t> numbers(new_vertex_at.size());
  std::iota(numbers.begin(), numbers.end(), 0u);
  const std::vector<uint32_t> components = non_manifold_components(moved, numbers);
  added.components.resize(added.position_ids.size(), kNone);
  for (uint32_t p = 0; p < new_vertex_at.size(); ++p)
    if (new_vertex_at[p] != kNone && components[p] != kNone)
      added.components[new_vertex_at[p] - kAddedVertex] = new_vertex_at[components[p]];
}

}  // namespace

float move_vertices(const GroupMesh& group, std::span<const Triangle> triangles,
                    std::span<const Vec3> positions, Simplified& result) {
  const float unscale = 1.0f / group.source.scale;
  std::vector<uint32_t> new_vertex_at(group.position_count(), kNone);
  std::vector<uint8_t> has_moved(group.vertices.size(), 0);
  std::vector<Triangle> of_positions;
  float farthest = 0;
  for (const Triangle& t : triangles) {
    of_positions.push_back(group.positions_of(t));
    for (const uint32_t v : t) {
      if (std::exchange(has_moved[v], 1)) continue;
      const uint32_t p = group.position_of[v];
      move_vertex(group, v, positions[p], new_vertex_at[p], result);
      farthest = std::max(farthest, length(positions[p] - group.positions[v] * unscale));
    }
  }
  add_non_manifold_components(of_positions, new_vertex_at, result.added);
  return farthest;
}

void renew_positions(const GroupMesh& group, Simplified& result) {
  std::vector<Vec3> positions(group.position_count());
  for (const Triangle& t : result.mesh.triangles)
    for (const uint32_t v : t) positions[group.position_of[v]] = result.mesh.positions[v];
  move_vertices(group, result.mesh.triangles, positions, result);
}

}  // namespace umbel::lod
