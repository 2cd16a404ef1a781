// Wavefront OBJ: polygons, materials' names, vertex colours. Its text is read in blocks by all
// threads, and the result is the same for any number of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
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
  std::vector<Vec4> colors;              ///< fractions, in sRGB; white where a vertex has none
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

struct ObjBlock;
struct ObjCounts;

/// Takes a file's blocks one after the other.
class ObjSink {
 public:
  virtual ~ObjSink() = default;
  /// May take the block's arrays apart. `before`: rows of the tables that stand before it.
  virtual void take(ObjBlock& block, const ObjCounts& before) = 0;
  /// After all blocks: the index of a vertex, a texture coordinate or a normal that is beyond the
  /// tables, of the block of this number.
  struct Bad {
    size_t block;
    bool is_attribute;
  };
  virtual std::optional<Bad> bad_index(const ObjCounts& total) const = 0;
};

/// Reads a file whose mesh need not fit into memory. Gives the notes; throws like `read_obj`, and
/// kInvalidMesh for the first face with a vertex that is not there.
std::vector<std::string> read_obj_blocks(const ByteSource& source, const std::string& name,
                                         ObjSink& sink, size_t block_bytes = size_t{1} << 20);

}  // namespace umbel::io
