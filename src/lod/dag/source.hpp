// What every stage of the LOD build reads and none writes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/big_vector.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/topology.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

struct Source {
  Mesh mesh;  ///< welded; its triangles are there until the first clusters are
  std::vector<uint32_t> position_ids;             ///< one a vertex
  std::vector<uint32_t> caller_vertices;          ///< one a vertex: the input's, or kNone if made
  bool has_wedges = false;                        ///< several vertices at one position
  std::vector<uint32_t> non_manifold_components;  ///< one a position id, see topology.hpp
  std::vector<uint32_t> vertex_materials;         ///< one a vertex; empty where all are 0
  std::vector<uint8_t> several_materials;         ///< position ids where materials meet, or empty
  /// Power of two by which positions are multiplied for simplification, so that areas and volumes
  /// of very small and very large meshes stay within the range of float.
  float scale = 1.0f;

  uint32_t material(uint32_t vertex) const {
    return vertex_materials.empty() ? 0 : vertex_materials[vertex];
  }
};

/// Vertices that simplification made. In triangles they are kAddedVertex plus their number here.
struct AddedVertices {
  Mesh mesh;  ///< no triangles
  /// Of a vertex at the same position; kAddedVertex plus its number for an earlier one of these;
  /// kNone: a new position.
  std::vector<uint32_t> position_ids;
  std::vector<uint32_t> materials;  ///< one a vertex
  /// Empty, or of each vertex: where it touches a non-manifold edge, a new position that stands for
  /// all that are joined to it by such edges, as the vertex there; else kNone.
  std::vector<uint32_t> components;
};
inline constexpr uint32_t kAddedVertex = 0x80000000u;

/// Appends a copy of a vertex of `from` to `to`, in every stream that `from` has.
void append_vertex(Mesh& to, const Mesh& from, uint32_t vertex);

/// Gives the vertices a place in the source; returns the number of the first. Throws kUnsupported
/// where there would be too many.
uint32_t append_vertices(Source& source, const AddedVertices& added);

/// Source::scale of a mesh with this box.
float simplification_scale(const Aabb& box);

/// Welds and prepares a valid mesh, without its non-manifold components.
Source make_source(const MeshView& mesh, const BuildOptions& options);

/// Finds what follows from the mesh's vertices: position ids, and with `vertex_materials` where
/// several meet.
void find_shared_positions(Source& source);

/// Renumbers vertices in the order in which `clusters` use them, so that neighbours are near
/// each other in memory. The mesh's triangles are not. Returns the new numbers.
BigVector<uint32_t> order_vertices(Source& source, ClusterSet& clusters);

/// Finds the non-manifold components of the surface in `clusters`, and frees the mesh's
/// triangles. Returns how many are degenerate. Whether an edge between two `frozen` positions is
/// manifold, nobody knows who has not all triangles: such edges join nothing, and what is here of
/// those that are doubtful, as directed edges, goes to `undecided`.
size_t settle_source(Source& source, const ClusterSet& clusters,
                     std::span<const uint32_t> frozen = {},
                     std::vector<PositionPair>* undecided = nullptr);

}  // namespace umbel::lod
