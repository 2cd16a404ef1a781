// Triangles of tables in files: any number of parts, each with vertices of its own.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/color_scale.hpp"
#include "io/source/column.hpp"
#include "io/source/triangle_source.hpp"

namespace umbel::io {

/// Further texture coordinates, joints or weights: as many values as the kind has.
struct ExtraColumn {
  Extra extra;
  Column column;
};

/// A mesh whose vertices are rows of tables.
struct TablePart {
  std::string name;  ///< of the file, in messages
  Column positions;  ///< 3 values; 9: the rows are triangles, three corners each
  Column normals;    ///< 3
  Column tangents;   ///< 4
  Column uvs;        ///< 2
  Column colors;     ///< 3 or 4
  Column indices;    ///< 3, a row a triangle; without it, three vertices in a row are one
  Column uv_indices, normal_indices;       ///< 3; where these streams have rows of their own
  std::vector<ExtraColumn> extras;         ///< in any order
  Column materials;                        ///< 1, a row a triangle
  uint32_t material = 0;                   ///< of all triangles, where there are no `materials`
  std::vector<uint32_t> material_numbers;  ///< of values in `materials`; beyond: the value
  uint32_t default_material = kNone;       ///< of rows of `materials` that are kNone
  ColorScale color_scale;                  ///< with kNoColor for what is not there
  bool are_colors_srgb = false;            ///< else linear; alpha is
  /// Three rows of four: where the part's vertices are in the world.
  std::optional<std::array<double, 12>> transform;

  uint64_t triangles = 0;
  uint64_t vertices = 0;  ///< filled by TableSource
};

struct TableLayout {
  std::vector<std::filesystem::path> files;
  std::vector<Table> tables;
  std::vector<TablePart> parts;
  bool has_materials = false;
};

/// Normals that are off unit length by over a hundredth are made unit length. Parts without a
/// stream that others have get zeros, and white. Joints without weight are 0.
class TableSource final : public TriangleSource {
 public:
  /// Throws kInvalidArgument for tables that do not fit each other and kCorrupt for one that its
  /// file is too short for.
  explicit TableSource(TableLayout layout);

  uint64_t triangles() const override { return first_.back(); }
  SourceStreams streams() const override { return streams_; }
  TriangleBlock read(uint64_t begin, uint64_t end) const override;
  /// The numbers of the files that reading these triangles needs, rising.
  std::vector<uint32_t> files(uint64_t begin, uint64_t end) const;

 private:
  void find_extras();
  void check(TablePart& part) const;
  void check(const Column& column, size_t width, uint64_t rows, const TablePart& part) const;

  TableLayout layout_;
  std::vector<uint64_t> first_;  // triangle of each part, and of none
  SourceStreams streams_;
};

}  // namespace umbel::io
