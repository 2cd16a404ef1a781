// One group of clusters, gathered for simplification.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/hash_index.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"
#include "lod/simplify/group_attributes.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// Vertices and positions are numbered from 0, in the order of first use. Methods read it; only
/// `gather` and the caller's decimation change it. Keeps its memory from group to group.
class GroupMesh {
 public:
  GroupMesh(const Source& s, const Config& c) : source(s), config(c), attributes(s, c) {}

  /// `is_locked` is by position id.
  void gather(const ClusterSet& set, std::span<const uint32_t> clusters,
              std::span<const uint8_t> is_locked);

  size_t position_count() const { return position_ids.size(); }
  Triangle positions_of(const Triangle& t) const {
    return {position_of[t[0]], position_of[t[1]], position_of[t[2]]};
  }
  bool is_degenerate(const Triangle& t) const {
    const auto [a, b, c] = positions_of(t);
    return a == b || b == c || c == a;
  }
  /// `triangles` as positions.
  std::span<const Triangle> position_triangles();
  uint32_t material(uint32_t vertex) const;
  std::vector<uint32_t> materials() const;  ///< of all vertices; empty where the source has one
  /// Whether any triangle does.
  bool mixes_materials(std::span<const Triangle> some) const;
  /// Whether several materials meet at a position.
  bool is_material_border(uint32_t position) const {
    return !source.several_materials.empty() && source.several_materials[position_ids[position]];
  }

  /// Appends vertices that simplification has made; `added.position_ids` become known.
  void append(const Mesh& made, AddedVertices& added);
  /// Takes them away again.
  void remove_appended();

  const Source& source;
  const Config& config;
  std::vector<Triangle> triangles;
  std::vector<uint32_t> vertices;                // in the source, or kAddedVertex and more
  std::vector<uint32_t> position_of;             // of vertices
  std::vector<Vec3> positions;                   // of vertices, scaled
  GroupAttributes attributes;                    // of vertices
  std::vector<uint32_t> position_ids;            // of positions
  std::vector<uint8_t> locked;                   // of positions
  std::vector<uint32_t> non_manifold_component;  // of positions, see topology.hpp
  bool has_non_manifold = false;                 // any of them

 private:
  void gather_triangles(const ClusterSet& set, std::span<const uint32_t> clusters);
  void number_positions();
  void drop_repeated_triangles();

  std::vector<uint32_t> added_materials_;
  std::vector<Triangle> position_triangles_;  // once asked for
  HashIndex index_;                           // scratch
};

}  // namespace umbel::lod
