// Triangles that are read block by block.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "umbel/mesh.hpp"

namespace umbel::io {

/// Which streams all blocks of a source have.
struct SourceStreams {
  bool normals = false, tangents = false, uvs = false, colors = false, materials = false;
  std::vector<Extra> extras;
  bool operator==(const SourceStreams&) const = default;
};

/// Some triangles and the vertices that they use. Streams as in MeshView.
struct TriangleBlock {
  uint64_t first = 0;  ///< number of the first triangle in the source
  std::vector<Vec3d> positions;
  std::vector<Triangle> triangles;  ///< of this block's vertices
  std::vector<Vec3> normals;
  std::vector<Vec4> tangents;
  std::vector<Vec2> uvs;
  std::vector<Vec4> colors;
  std::vector<uint32_t> materials;
  std::vector<float> extra_values;
};

/// A mesh whose triangles can be read in any range, by several threads at once. The same range
/// gives the same block; vertices that ranges share are in each of their blocks, with the same
/// bits.
class TriangleSource {
 public:
  virtual ~TriangleSource() = default;
  virtual uint64_t triangles() const = 0;
  virtual SourceStreams streams() const = 0;
  /// The triangles [begin, end), which are there, and the vertices that they use. Throws kIo,
  /// kCorrupt, and kInvalidMesh for an index beyond the vertices or a value that is not finite,
  /// naming the file and the triangle.
  virtual TriangleBlock read(uint64_t begin, uint64_t end) const = 0;
};

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
