// Meshes whose triangles jump about among their vertices, put in order once: else each block would
// read all of the vertices.
//
// An external sort by distribution (Knuth, "The Art of Computer Programming", volume 3, 5.4):
// vertices are cut into ranges that fit into memory, each block's into the ranges; then range by
// range the rows go to where their blocks will look for them.
#pragma once

#include <cstdint>
#include <filesystem>

#include "io/source/table_source.hpp"

namespace umbel::io {

struct CoherenceConfig {
  uint64_t block = kBlockTriangles;            ///< triangles that find their vertices together
  uint64_t range_bytes = uint64_t{64} << 20;   ///< of vertices in memory
  uint64_t least_bytes = uint64_t{256} << 20;  ///< of vertices: fewer are read again and again
  uint64_t most_waste = 4;  ///< times the bytes that are needed: more is incoherent
};

/// Whether blocks of the part read much more of the vertices than they need, by a few of them.
bool is_incoherent(const TableLayout& layout, const TablePart& part,
                   const CoherenceConfig& config = {});

/// Replaces a part by one or more with the same triangles in the same order, whose files have names
/// that begin with `prefix`. Throws kInvalidMesh for an index that is beyond the vertices.
void make_coherent(TableLayout& layout, size_t part, const std::filesystem::path& prefix,
                   const CoherenceConfig& config = {});

}  // namespace umbel::io
