// What a block of an OBJ file's lines says, before it is known what the blocks before it hold.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "io/color_scale.hpp"
#include "io/text_blocks.hpp"

namespace umbel::io {

/// In place of an index: the corner has none, or one that no table can have.
inline constexpr int32_t kNoIndex = -1;
inline constexpr int32_t kBadIndex = std::numeric_limits<int32_t>::max();

/// A table's indices, one a corner. Those that count back are from the block's own first row,
/// and `relative` has their places.
struct ObjIndices {
  std::vector<int32_t> values;  ///< empty: no corner of the block has any
  std::vector<uint32_t> relative;
};

/// Lines of one kind that are left out, or are at fault.
struct ObjLines {
  uint64_t count = 0;
  uint64_t first = 0;  ///< line in the block, from 0
  std::string word;    ///< the first one's keyword
};

struct ObjBlock {
  uint64_t offset = 0, size = 0;  ///< in the text
  uint64_t lines = 0;

  std::vector<double> positions;  ///< 3 a vertex
  std::vector<float> colors;      ///< 4 a vertex, kNoColor if not given; empty: in all the block
  std::vector<float> uvs;         ///< 2 each
  std::vector<float> normals;     ///< 3 each

  ObjIndices v, vt, vn;
  uint32_t faces = 0, triangles = 0;
  std::vector<uint32_t> sizes;  ///< corners of each face; empty: three

  /// `usemtl`: the material of triangles from `triangle` on.
  struct Use {
    uint32_t triangle, name;
  };
  std::vector<Use> uses;
  std::vector<std::string> names;      ///< of materials, none twice
  std::vector<std::string> libraries;  ///< what follows each `mtllib`

  /// Objects and groups (`o`, `g`) that the block's faces are in, none twice.
  std::vector<std::string> parts;
  bool continues_part = false;           ///< a face is in that of the block before
  std::optional<std::string> open_part;  ///< the one at the end, if no face of the block is in it

  ObjLines short_faces, points_and_lines, curves, files, unknown;
  ObjLines numbers;  ///< that fit no mesh: weights of vertices, depths of textures
  ObjLines paint;    ///< colours of vertices in comments
  std::optional<uint64_t> first_known;  ///< the first line with a statement of the format
  bool says_empty = false;              ///< a comment says that a mesh without faces is meant

  struct Fault {
    uint64_t line;  ///< in the block, from 0
    std::string what;
  };
  std::optional<Fault> fault;  ///< where reading stopped

  size_t vertices() const { return positions.size() / 3; }
  /// Corners of face k.
  uint32_t corners(size_t k) const { return sizes.empty() ? 3 : sizes[k]; }
};

/// Never throws for what the text says: see `fault`.
ObjBlock parse_obj_block(const TextBlock& text);

/// How many of each there are.
struct ObjCounts {
  uint64_t v = 0, vt = 0, vn = 0;
};

/// The first corner of a block's faces whose index is beyond the file's tables: "vertex index 9 is
/// beyond the 4 there are". `before` are the rows of the blocks before. Only texture coordinates
/// and normals are checked where `only_attributes`.
std::optional<ObjBlock::Fault> find_bad_index(const TextBlock& text, ObjCounts before,
                                              const ObjCounts& total, bool only_attributes);

}  // namespace umbel::io
