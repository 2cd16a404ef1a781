// Meshes out of vertex and index buffers with strides and offsets.
#include <cstring>
#include <string>

#include "base/parallel.hpp"
#include "umbel/mesh_buffers.hpp"

namespace umbel {
namespace {

constexpr size_t kRowsAtOnce = 1 << 14;

[[noreturn]] void reject(const std::string& sentence) {
  throw Error(ErrorCode::kInvalidArgument, "read_buffers: " + sentence);
}

template <typename Value>
std::vector<Value> read_stream(const VertexStream& stream, size_t count, const char* name) {
  std::vector<Value> values;
  if (!stream.data || count == 0) return values;
  const size_t stride = stream.stride == 0 ? sizeof(Value) : stream.stride;
  if (stride < sizeof(Value))
    reject(std::string(name) + " have a stride of " + std::to_string(stride) +
           " bytes, but a value has " + std::to_string(sizeof(Value)));
  values.resize(count);
  const auto* bytes = static_cast<const unsigned char*>(stream.data) + stream.offset;
  parallel_for(count, kRowsAtOnce, [&](size_t i) {
    std::memcpy(static_cast<void*>(&values[i]), bytes + i * stride, sizeof(Value));
  });
  return values;
}

template <typename Index>
void read_indices(const MeshBuffers& buffers, std::vector<Triangle>& triangles) {
  const auto* bytes = static_cast<const unsigned char*>(buffers.indices);
  parallel_for(triangles.size(), kRowsAtOnce, [&](size_t i) {
    for (size_t k = 0; k < 3; ++k) {
      Index index;
      std::memcpy(&index, bytes + (3 * i + k) * sizeof index, sizeof index);
      const uint64_t vertex = uint64_t{index} + buffers.base_vertex;
      // What no vertex can have is left for `validate` to find.
      triangles[i][k] = vertex < kNone ? static_cast<uint32_t>(vertex) : kNone;
    }
  });
}

}  // namespace

Mesh read_buffers(const MeshBuffers& buffers, const BuildOptions& options) {
  if (!buffers.positions.data && buffers.vertex_count > 0) reject("there are no positions");
  if (!buffers.indices && buffers.triangle_count > 0) reject("there are no indices");
  if (buffers.index_bytes != 2 && buffers.index_bytes != 4)
    reject("index_bytes is " + std::to_string(buffers.index_bytes) + ", must be 2 or 4");
  Mesh mesh;
  with_threads(options.threads, [&] {
    const size_t count = buffers.vertex_count;
    mesh.positions = read_stream<Vec3>(buffers.positions, count, "positions");
    mesh.normals = read_stream<Vec3>(buffers.normals, count, "normals");
    mesh.tangents = read_stream<Vec4>(buffers.tangents, count, "tangents");
    mesh.uvs = read_stream<Vec2>(buffers.uvs, count, "uvs");
    mesh.colors = read_stream<Vec4>(buffers.colors, count, "colors");
    mesh.triangles.resize(buffers.triangle_count);
    if (buffers.index_bytes == 2)
      read_indices<uint16_t>(buffers, mesh.triangles);
    else
      read_indices<uint32_t>(buffers, mesh.triangles);
  });
  mesh.materials.assign(buffers.materials.begin(), buffers.materials.end());
  return mesh;
}

}  // namespace umbel
