// Meshes of any size, read block by block: what builds in units take (scale.hpp).
//
//   class Terrain final : public umbel::TriangleSource {
//     uint64_t triangles() const override { return 2ull * 40000 * 40000; }
//     umbel::TriangleBlock read(uint64_t begin, uint64_t end) const override { ... }
//   };
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel {

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
/// bits. Triangles are joined where positions are equal, so blocks need not share vertices.
class UMBEL_API TriangleSource {
 public:
  virtual ~TriangleSource() = default;
  virtual uint64_t triangles() const = 0;
  virtual SourceStreams streams() const { return {}; }
  /// The triangles [begin, end), which are there, and the vertices that they use. May throw
  /// anything; what is not finite or out of range should be kInvalidMesh, naming the triangle.
  virtual TriangleBlock read(uint64_t begin, uint64_t end) const = 0;
};

/// A mesh in memory, which must live longer, as a source. Its positions are relative to `origin`;
/// `name` names it in errors.
UMBEL_API std::unique_ptr<TriangleSource> source_of(const MeshView& mesh, const Vec3d& origin = {},
                                                    std::string name = "the mesh");

}  // namespace umbel
