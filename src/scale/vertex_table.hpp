// Welds vertices by value: position, attributes and material, all bit for bit, with -0 as 0.
#pragma once

#include <cstdint>
#include <vector>

#include "base/hash_index.hpp"
#include "umbel/mesh.hpp"

namespace umbel::scale {

class VertexTable {
 public:
  /// The number of a vertex of `from`, which has the same streams in every call.
  uint32_t insert(const Mesh& from, uint32_t vertex, uint32_t material);

  size_t size() const { return hashes_.size(); }
  /// Makes room for so many vertices in all.
  void reserve(size_t vertices);
  /// The vertices, rising by number, without triangles and without -0.
  Mesh take_mesh();
  std::vector<uint32_t> take_materials() { return std::move(materials_); }

 private:
  void grow(size_t room);

  Mesh mesh_;
  std::vector<uint32_t> materials_;
  std::vector<uint32_t> row_, rows_;  // of one vertex, and of all, as words
  std::vector<uint64_t> hashes_;
  HashIndex index_;
};

/// Of all vertices.
void drop_negative_zeros(Mesh& mesh);

}  // namespace umbel::scale
