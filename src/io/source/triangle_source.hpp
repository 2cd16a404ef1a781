// Triangles that are read block by block: umbel/triangle_source.hpp, and what reads them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "umbel/triangle_source.hpp"

namespace umbel::io {

using umbel::SourceStreams;
using umbel::TriangleBlock;
using umbel::TriangleSource;

/// Triangles of one block, unless a caller knows better.
inline constexpr uint64_t kBlockTriangles = uint64_t{1} << 18;

/// Calls visit(block) for the triangles [begin, end) in order, `size` at a time. Blocks are read
/// ahead by all threads, two a thread; of several that cannot be read, the first one's error is
/// thrown.
void for_each_block(const TriangleSource& source, uint64_t begin, uint64_t end, uint64_t size,
                    const std::function<void(TriangleBlock&&)>& visit);

/// Throws kInvalidMesh for the first of the block's triangles, from `triangle` on, with a vertex,
/// from `vertex` on, that has a value that is not finite. `name` is of the file, and `first` the
/// number of that triangle there.
void check_finite(const TriangleBlock& block, const std::string& name, uint64_t first,
                  size_t vertex = 0, size_t triangle = 0);

}  // namespace umbel::io
