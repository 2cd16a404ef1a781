// Meshes in vertex and index buffers as engines have them, with strides and offsets.
//
//   MeshBuffers buffers;
//   buffers.vertex_count = vertices.size();
//   buffers.positions = {vertices.data(), sizeof(Vertex), offsetof(Vertex, position)};
//   buffers.uvs = {vertices.data(), sizeof(Vertex), offsetof(Vertex, uv)};
//   buffers.indices = indices.data();  // 16 bits each
//   buffers.index_bytes = 2;
//   buffers.triangle_count = indices.size() / 3;
//   const Mesh mesh = read_buffers(buffers);
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "umbel/mesh.hpp"

namespace umbel {

/// Values of vertices in a buffer of anybody's layout: vertex i's begin `offset + i * stride` bytes
/// behind `data`, at any alignment. Null: the mesh has none.
struct VertexStream {
  const void* data = nullptr;
  size_t stride = 0;  ///< in bytes; 0: one right after the other
  size_t offset = 0;  ///< in bytes
};

/// A mesh in vertex and index buffers as engines have them, interleaved or not.
struct MeshBuffers {
  size_t vertex_count = 0, triangle_count = 0;
  VertexStream positions;                    ///< 3 floats
  VertexStream normals = {};                 ///< 3 floats
  VertexStream tangents = {};                ///< 4 floats
  VertexStream uvs = {};                     ///< 2 floats
  VertexStream colors = {};                  ///< 4 floats
  const void* indices = nullptr;             ///< 3 a triangle
  uint32_t index_bytes = 4;                  ///< of an index: 2 or 4
  uint32_t base_vertex = 0;                  ///< added to each index
  std::span<const uint32_t> materials = {};  ///< one a triangle, or empty
};

/// A copy of a mesh in buffers. Vertex i is vertex i of the buffers. Throws kInvalidArgument where
/// something is missing, a stride is shorter than a value, or `index_bytes` is not 2 or 4; indices
/// are checked by `validate`.
UMBEL_API Mesh read_buffers(const MeshBuffers& buffers, const BuildOptions& options = {});

}  // namespace umbel
