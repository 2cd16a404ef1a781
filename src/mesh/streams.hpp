// What every algorithm on a MeshView checks before it reads: lengths and index range.
#pragma once

#include "umbel/mesh.hpp"

namespace umbel {

/// Triangles that one task looks at.
inline constexpr size_t kTriangleChunk = size_t{1} << 15;

/// Throws kInvalidArgument if an optional stream is neither empty nor of the right length.
void check_streams(const MeshView& mesh);

/// Throws kInvalidMesh, naming the first offender, if an index is out of range.
void check_indices(const MeshView& mesh);

/// The first corner (0, 1, 2) of a triangle that `validate` rejects, or 3.
uint32_t first_invalid_corner(const MeshView& mesh, size_t triangle);

}  // namespace umbel
