#include "scale/vertex_table.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "base/hash.hpp"
#include "lod/dag/source.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel::scale {
namespace {

// All that tells a vertex from others.
void write_row(const Mesh& mesh, uint32_t vertex, uint32_t material, std::vector<uint32_t>& row) {
  row.assign(1, material);
  const auto append = [&](const auto& stream) {
    if (stream.empty()) return;
    const auto bits = value_bits(stream[vertex]);
    row.insert(row.end(), bits.begin(), bits.end());
  };
  append(mesh.positions);
  append(mesh.normals);
  append(mesh.tangents);
  append(mesh.uvs);
  append(mesh.colors);
  const size_t width = extra_width(mesh.extras);
  for (size_t i = 0; i < width; ++i)
    row.push_back(value_bits(std::array<float, 1>{mesh.extra_values[width * vertex + i]})[0]);
}

}  // namespace

void VertexTable::grow(size_t room) {
  index_.reset(room);
  const auto never = [](uint32_t) { return false; };  // rows differ from each other
  for (uint32_t i = 0; i < size(); ++i) index_.find_or_insert(hashes_[i], i, never);
}

uint32_t VertexTable::insert(const Mesh& from, uint32_t vertex, uint32_t material) {
  if (size() >= index_.room()) grow(2 * size() + 16);
  write_row(from, vertex, material, row_);
  uint64_t hash = row_.size();
  for (const uint32_t word : row_) hash = mix64(hash ^ word);
  const auto next = static_cast<uint32_t>(size());
  const uint32_t found = index_.find_or_insert(hash, next, [&](uint32_t i) {
    return std::equal(row_.begin(), row_.end(), rows_.begin() + row_.size() * i);
  });
  if (found != next) return found;
  rows_.insert(rows_.end(), row_.begin(), row_.end());
  hashes_.push_back(hash);
  materials_.push_back(material);
  lod::append_vertex(mesh_, from, vertex);
  mesh_.extras = from.extras;
  return next;
}

void VertexTable::reserve(size_t vertices) {
  if (vertices > index_.room()) grow(vertices);
}

Mesh VertexTable::take_mesh() {
  drop_negative_zeros(mesh_);
  return std::move(mesh_);
}

void drop_negative_zeros(Mesh& mesh) {
  const auto normalise = [](auto& stream) {
    for (auto& value : stream) value = without_negative_zero(value);
  };
  normalise(mesh.positions), normalise(mesh.normals), normalise(mesh.tangents);
  normalise(mesh.uvs), normalise(mesh.colors);
  for (float& value : mesh.extra_values) value += 0.0f;
}

}  // namespace umbel::scale
