// What every stage of the LOD build reads and none writes.
#pragma once

#include <cstdint>
#include <vector>

#include "umbel/lod.hpp"

namespace umbel::lod {

struct Source {
  Mesh mesh;                                   ///< welded
  std::vector<uint32_t> position_ids;          ///< one a vertex
  bool has_wedges = false;                     ///< several vertices at one position
  std::vector<uint32_t> irregular_components;  ///< one a position id, see topology.hpp
  std::vector<uint32_t> vertex_materials;      ///< one a vertex; empty where all are 0
  std::vector<uint8_t> several_materials;      ///< position ids where materials meet, or empty
  /// Power of two by which positions are multiplied for simplification, so that areas and volumes
  /// of very small and very large meshes stay within the range of float.
  float scale = 1.0f;

  uint32_t material(uint32_t vertex) const {
    return vertex_materials.empty() ? 0 : vertex_materials[vertex];
  }
};

/// Welds and prepares a valid mesh.
Source make_source(const MeshView& mesh, const BuildOptions& options);

}  // namespace umbel::lod
