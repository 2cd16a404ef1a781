// What a unit leaves: the clusters that go on to the next tier, and all that the units there must
// know of how they came about. A slice of it has the clusters of one unit of the next tier.
#pragma once

#include <cstdint>
#include <vector>

#include "lod/dag/cluster_set.hpp"
#include "umbel/mesh.hpp"

namespace umbel::scale {

/// Two positions, from the first to the second where the direction counts.
struct PositionEdge {
  Vec3 from, to;
  bool operator==(const PositionEdge&) const = default;
};

/// A group that generated clusters. Ids are those of all units.
struct Generator {
  uint64_t id;
  Sphere sphere;
  float error;
  uint32_t unused = 0;
};

/// Bits of Exits::flags.
enum VertexFlag : uint8_t {
  kWasLocked = 1,         ///< a border of the last round
  kWasFrozen = 2,         ///< in any tier
  kMayBeShared = 4,       ///< clusters of two units of the next tier may have the position
  kSeveralMaterials = 8,  ///< materials met here
};

struct Exits {
  Mesh vertices;                    ///< of the clusters, without triangles
  std::vector<uint32_t> materials;  ///< one a vertex; empty where all are 0
  std::vector<uint32_t> labels;     ///< one a vertex: equal ones are joined by non-manifold edges
  std::vector<uint8_t> flags;       ///< one a vertex, see VertexFlag
  lod::ClusterSet clusters;         ///< generating_group: of `generators`
  std::vector<Sphere> spheres;      ///< of clusters: generating groups', or their own
  std::vector<Generator> generators;
  std::vector<PositionEdge> locked_edges;  ///< that may come to lie in two pieces of surface
  /// After the first tier: directed edges between frozen positions, whose other sides may be
  /// elsewhere.
  std::vector<PositionEdge> undecided;
  std::vector<Vec3> new_positions;  ///< that the unit has made, wherever they are now
};

/// The given clusters, with what belongs to them; no edges.
Exits select_clusters(const Exits& from, const std::vector<uint32_t>& clusters);
/// All clusters, without vertices and generators that none of them has; no edges.
Exits with_used_only(Exits&& from);

/// Calls visit(member) for all arrays.
template <typename Visit>
void for_each_array(Mesh& mesh, Visit& visit) {
  visit(mesh.positions), visit(mesh.normals), visit(mesh.tangents), visit(mesh.uvs);
  visit(mesh.colors), visit(mesh.extras), visit(mesh.extra_values);
}
template <typename Visit>
void for_each_array(lod::ClusterSet& set, Visit& visit) {
  visit(set.vertex_offsets), visit(set.triangle_offsets), visit(set.vertices), visit(set.corners);
  visit(set.generating_group), visit(set.material), visit(set.boxes);
}
template <typename Visit>
void for_each_array(Exits& exits, Visit& visit) {
  for_each_array(exits.vertices, visit);
  visit(exits.materials), visit(exits.labels), visit(exits.flags);
  for_each_array(exits.clusters, visit);
  visit(exits.spheres), visit(exits.generators), visit(exits.locked_edges), visit(exits.undecided);
  visit(exits.new_positions);
}
}  // namespace umbel::scale
