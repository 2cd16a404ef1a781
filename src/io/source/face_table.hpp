// The faces of a binary PLY file: whether they are triangles, and if not, triangles of them.
#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "io/source/column.hpp"

namespace umbel::io {

/// One property of a row: a value, or a list after its length.
struct FaceProperty {
  Scalar type;
  std::optional<Scalar> length;
};

/// Rows one after the other, of which nothing else says how long they are.
struct FaceRows {
  std::filesystem::path path;
  std::string name;     ///< in messages
  uint64_t offset = 0;  ///< of the first row
  uint64_t rows = 0;
  bool big_endian = false;
  std::vector<FaceProperty> properties;
  size_t indices = 0;              ///< which property is the list of vertices
  std::optional<size_t> material;  ///< which is the material
};

struct FaceScan {
  bool are_triangles = true;  ///< each row has three vertices, and other lists of one length
  uint64_t row_bytes = 0;     ///< of each row then
  uint32_t index_offset = 0, material_offset = 0;  ///< in each row then
  uint64_t triangles = 0;
  uint64_t small_faces = 0;  ///< have fewer than three vertices, and make no triangle
  uint64_t end = 0;          ///< byte after the last row
  int64_t least_material = std::numeric_limits<int64_t>::max();
  int64_t largest_material = std::numeric_limits<int64_t>::min();
};

/// Reads all rows. Throws kCorrupt, naming the byte, where the file ends too early or a list has no
/// length that could be.
FaceScan scan_faces(const FaceRows& faces);

/// Bytes of a row that `write_triangles` writes: three indices and the material.
inline constexpr uint64_t kTriangleRow = 16;

/// Writes a little-endian table of triangles: fans around the first corner of each face.
FaceScan write_triangles(const FaceRows& faces, const std::filesystem::path& path);

}  // namespace umbel::io
