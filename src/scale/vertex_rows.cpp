#include "scale/vertex_rows.hpp"

#include <array>
#include <bit>
#include <cstring>

namespace umbel::scale {
namespace {

template <typename Vector>
void put(const Vector& value, std::vector<float>& rows) {
  for (float f : std::bit_cast<std::array<float, sizeof(Vector) / sizeof(float)>>(value))
    rows.push_back(f);
}

template <typename Vector>
const float* get(const float* from, bool wanted, std::vector<Vector>& stream) {
  if (!wanted) return from;
  Vector value;
  std::memcpy(&value, from, sizeof(Vector));
  stream.push_back(value);
  return from + sizeof(Vector) / sizeof(float);
}

}  // namespace

uint32_t VertexRows::floats(const io::SourceStreams& s) {
  return 3u + (s.normals ? 3u : 0u) + (s.tangents ? 4u : 0u) + (s.uvs ? 2u : 0u) +
         (s.colors ? 4u : 0u) + extra_width(s.extras);
}

void VertexRows::append(uint32_t v, std::vector<float>& rows) const {
  put(points_[v], rows);
  if (streams_.normals) put(block_.normals[v], rows);
  if (streams_.tangents) put(block_.tangents[v], rows);
  if (streams_.uvs) put(block_.uvs[v], rows);
  if (streams_.colors) put(block_.colors[v], rows);
  const size_t width = extra_width(streams_.extras);
  for (size_t k = 0; k < width; ++k) rows.push_back(block_.extra_values[v * width + k]);
}

void VertexRows::split(std::span<const float> rows, const io::SourceStreams& streams, Mesh& mesh) {
  const size_t width = extra_width(streams.extras);
  const float* at = rows.data();
  const float* const end = at + rows.size();
  while (at != end) {
    at = get(at, true, mesh.positions);
    at = get(at, streams.normals, mesh.normals);
    at = get(at, streams.tangents, mesh.tangents);
    at = get(at, streams.uvs, mesh.uvs);
    at = get(at, streams.colors, mesh.colors);
    mesh.extra_values.insert(mesh.extra_values.end(), at, at + width);
    at += width;
  }
}

}  // namespace umbel::scale
