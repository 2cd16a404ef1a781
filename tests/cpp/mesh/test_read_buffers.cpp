#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>

#include "umbel/mesh_buffers.hpp"

namespace umbel {
namespace {

#pragma pack(push, 1)
struct Vertex {  // at no alignment
  uint8_t flags = 0;
  float position[3], uv[2], normal[3], tangent[4], color[4];
};
#pragma pack(pop)

TEST(ReadBuffers, interleaved_vertices_and_short_indices_are_the_mesh) {
  const Mesh mesh = shapes::grid(7, 5);
  std::vector<Vertex> vertices(mesh.positions.size());
  for (size_t v = 0; v < vertices.size(); ++v) {
    const auto f = static_cast<float>(v);
    std::memcpy(vertices[v].position, &mesh.positions[v], sizeof(Vec3));
    const float uv[] = {f, -f}, normal[] = {0, f, 1}, four[] = {f, 1, 2, 3};
    std::memcpy(vertices[v].uv, uv, sizeof uv);
    std::memcpy(vertices[v].normal, normal, sizeof normal);
    std::memcpy(vertices[v].tangent, four, sizeof four);
    std::memcpy(vertices[v].color, four, sizeof four);
  }
  // Indices of a model that begins ten vertices earlier.
  std::vector<uint16_t> indices;
  for (const Triangle& t : mesh.triangles)
    for (const uint32_t v : t) indices.push_back(static_cast<uint16_t>(v));
  MeshBuffers buffers;
  buffers.vertex_count = vertices.size();
  buffers.positions = {vertices.data(), sizeof(Vertex), offsetof(Vertex, position)};
  buffers.uvs = {vertices.data(), sizeof(Vertex), offsetof(Vertex, uv)};
  buffers.normals = {vertices.data(), sizeof(Vertex), offsetof(Vertex, normal)};
  buffers.tangents = {vertices.data(), sizeof(Vertex), offsetof(Vertex, tangent)};
  buffers.colors = {vertices.data(), sizeof(Vertex), offsetof(Vertex, color)};
  buffers.indices = indices.data();
  buffers.index_bytes = 2;
  buffers.triangle_count = mesh.triangles.size();
  const Mesh read = read_buffers(buffers);
  EXPECT_EQ(read.positions, mesh.positions);
  EXPECT_EQ(read.triangles, mesh.triangles);
  EXPECT_EQ(read.uvs[9].y, -9.0f);
  EXPECT_EQ(read.normals[9].y, 9.0f);
  EXPECT_EQ(read.tangents[9].x, 9.0f);
  EXPECT_EQ(read.colors[9].w, 3.0f);
  EXPECT_NO_THROW(validate(read.view()));

  buffers.base_vertex = 10;
  EXPECT_THROW(validate(read_buffers(buffers).view()), Error);
  buffers.base_vertex = 0xffffffffu;
  EXPECT_EQ(read_buffers(buffers).triangles[0][1], kNone);
}

/// Positions and triangles where the mesh has them.
MeshBuffers tight_buffers(const Mesh& mesh) {
  MeshBuffers buffers;
  buffers.vertex_count = mesh.positions.size();
  buffers.positions = {mesh.positions.data()};
  buffers.indices = mesh.triangles.data();
  buffers.triangle_count = mesh.triangles.size();
  return buffers;
}

TEST(ReadBuffers, tight_streams_need_no_stride) {
  const Mesh mesh = shapes::blob(2, 1);
  const MeshBuffers buffers = tight_buffers(mesh);
  EXPECT_EQ(read_buffers(buffers).positions, mesh.positions);
  EXPECT_EQ(read_buffers(buffers).triangles, mesh.triangles);
  EXPECT_TRUE(read_buffers(buffers).normals.empty());
  EXPECT_TRUE(read_buffers({}).triangles.empty());
}

TEST(ReadBuffers, mistakes_are_named) {
  const Mesh mesh = shapes::blob(1, 1);
  const MeshBuffers good = tight_buffers(mesh);
  const auto reject = [&](const auto& spoil, const char* part) {
    MeshBuffers buffers = good;
    spoil(buffers);
    try {
      read_buffers(buffers);
      ADD_FAILURE() << part;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  reject([](MeshBuffers& b) { b.positions.data = nullptr; }, "positions");
  reject([](MeshBuffers& b) { b.indices = nullptr; }, "indices");
  reject([](MeshBuffers& b) { b.index_bytes = 3; }, "index_bytes");
  reject([](MeshBuffers& b) { b.positions.stride = 8; }, "stride");
}

}  // namespace
}  // namespace umbel
