// An OBJ file of any size as tables, written once.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/source/table_source.hpp"
#include "io/text_blocks.hpp"

namespace umbel::io {

struct ObjTables {
  TableLayout layout;  ///< one part; materials are the numbers of the names, kNone for none
  bool has_materials = false;
  bool misses_material = false;             ///< some triangles have none
  std::vector<std::string> material_names;  ///< in order of first use
  std::vector<std::string> libraries;       ///< what follows each `mtllib`
  std::vector<std::string> notes;           ///< what was left out, a sentence each
};

/// Writes files whose names begin with `prefix`. Throws like `read_obj`, and kInvalidMesh for the
/// first face with a vertex that is not there. Corners without a normal, in a file that has some,
/// have zero.
ObjTables write_obj_tables(const ByteSource& source, const std::string& name,
                           const std::filesystem::path& prefix,
                           size_t block_bytes = size_t{1} << 20);

}  // namespace umbel::io
