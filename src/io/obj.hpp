// Wavefront OBJ: polygons, materials' names, vertex colours. Its text is read in blocks by all
// threads, and the result is the same for any number of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/text_blocks.hpp"
#include "umbel/types.hpp"

namespace umbel::io {

/// A file's mesh. Arrays that the file has nothing for are empty.
///
/// Where each corner's texture coordinate and normal have its vertex's own number, vertices are
/// the file's, in its order. Else there is one for each combination that triangles use, in order
/// of their three numbers.
struct ObjMesh {
  std::vector<std::array<double, 3>> positions;
  std::vector<Vec4> colors;              ///< as written; white where a vertex has none
  std::vector<Vec2> uvs;                 ///< zero where a corner has none
  std::vector<Vec3> normals;             ///< as written; zero where a corner has none
  std::vector<uint32_t> without_normal;  ///< the vertices whose corners have none, ascending
  /// Polygons are fans around their first corner. kNone stands for a vertex that is not there.
  std::vector<Triangle> triangles;
  std::vector<uint32_t> materials;          ///< one a triangle: which of the names, or kNone
  std::vector<std::string> material_names;  ///< in order of first use
  std::vector<std::string> libraries;       ///< what follows each `mtllib`
  std::vector<std::string> notes;           ///< what was left out, a sentence each
  std::string fault;  ///< the first face with a vertex that is not there, and its line
};

/// Reads a whole file. Throws kCorrupt: "NAME, line 7: ...", with lines as editors count them.
ObjMesh read_obj(const ByteSource& source, const std::string& name,
                 size_t block_bytes = size_t{1} << 20);

}  // namespace umbel::io
