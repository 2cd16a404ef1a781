// A part of the surface as a small mesh of its own.
#pragma once

#include <vector>

#include "umbel/types.hpp"

namespace umbel::lod {

/// Triangles with vertices of their own, numbered from 0, so that all is close together.
struct SubMesh {
  std::vector<Triangle> triangles;
  std::vector<uint32_t> vertices;   ///< of vertices: their numbers in the source
  std::vector<Vec3> positions;      ///< of vertices
  std::vector<uint32_t> materials;  ///< of vertices; empty: one
};

}  // namespace umbel::lod
