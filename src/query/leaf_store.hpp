// The triangles of a structure's leaves, as every query reads them: flat arrays of words and a few
// numbers, nothing that points, so that a file is a dump of them. Queries other than rays go
// through the accessors alone, and so do not depend on how leaves are laid out.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "base/axis.hpp"
#include "base/big_vector.hpp"
#include "base/math.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel {

/// No child.
inline constexpr uint32_t kNoChild = 0xffffffffu;
/// A link to a leaf: this bit, then triangles - 1 in 3 bits, then the first reference. All ones
/// would be a leaf of 8 at the last reference that can be numbered, and is not used.
inline constexpr uint32_t kLeafBit = 0x80000000u;
inline constexpr uint32_t kLeafSizeShift = 28;
inline constexpr uint32_t kMaxLeafTriangles = 8;
inline constexpr uint32_t kLeafPadding = 8;
inline constexpr uint32_t kMaxReferences = (1u << kLeafSizeShift) - kMaxLeafTriangles;

struct RayKernels;
struct ShapeKernels;

/// One triangle of a leaf, with the very floats of the mesh it came from.
struct LeafTriangle {
  Vec3 p0, p1, p2;
  uint32_t primitive;
  uint32_t mask;
};

/// The triangles of a structure's leaves, what rays have to know of their size, and the queries.
struct LeafStore {
  LeafStore() = default;
  LeafStore(const LeafStore&) = default;
  LeafStore(LeafStore&&) = default;
  LeafStore& operator=(const LeafStore&) = default;
  LeafStore& operator=(LeafStore&&) = default;
  virtual ~LeafStore() = default;

  uint32_t triangle_count = 0;  ///< of the mesh, dropped ones included
  uint32_t reference_count = 0;
  uint32_t compact = 0;  ///< 1: leaves hold vertex numbers; 0: they hold corners
  uint32_t masked = 0;   ///< 1: leaves hold masks; 0: all bits are set in all masks
  Aabb bounds;           ///< of the triangles; empty where there are none

  /// reference_words() a reference. A leaf of n triangles is n times that many consecutive words:
  /// n times p0.x, n times p0.y, ... n times p2.z (compact: n times each vertex number), n times
  /// the primitive's number, n times its mask where masked. kLeafPadding words follow the last
  /// one, so that eight lanes can be loaded at any row.
  BigVector<uint32_t> leaves;
  BigVector<Vec3> vertices;  ///< compact: what the vertex numbers mean; else empty

  // Set by prepare_scale, never stored.
  /// The largest absolute coordinate of any box on each axis.
  alignas(16) float max_abs_coord[4] = {};
  float scale = 1;    ///< power of two that brings triangles of extreme size into a safe range
  float unscale = 1;  ///< 1 / scale

  // Set with the structure's nodes, never stored.
  const RayKernels* rays = nullptr;
  const ShapeKernels* shapes = nullptr;

  uint32_t corner_words() const { return compact ? 3 : 9; }
  uint32_t reference_words() const { return corner_words() + 1 + masked; }
  uint64_t leaf_bytes() const {
    return leaves.size() * sizeof(uint32_t) + vertices.size() * sizeof(Vec3);
  }

  static bool is_leaf(uint32_t link) { return (link & kLeafBit) != 0; }
  static uint32_t leaf_size(uint32_t link) { return ((link >> kLeafSizeShift) & 7u) + 1; }
  static uint32_t first_reference(uint32_t link) { return link & ((1u << kLeafSizeShift) - 1); }
  /// The link of the leaf of 1 to 8 triangles that begins there.
  static uint32_t leaf_link(uint32_t first, uint32_t count) {
    return kLeafBit | (count - 1) << kLeafSizeShift | first;
  }

  /// Triangle i of a leaf, 0 <= i < leaf_size(link).
  LeafTriangle triangle(uint32_t link, uint32_t i) const {
    const uint32_t n = leaf_size(link), rows = corner_words();
    const uint32_t* words = leaves.data() + size_t{first_reference(link)} * reference_words() + i;
    LeafTriangle result{};
    if (compact) {
      result.p0 = vertices[words[0]];
      result.p1 = vertices[words[n]];
      result.p2 = vertices[words[2 * n]];
    } else {
      const auto row = [&](uint32_t r) { return std::bit_cast<float>(words[r * n]); };
      result.p0 = {row(0), row(1), row(2)};
      result.p1 = {row(3), row(4), row(5)};
      result.p2 = {row(6), row(7), row(8)};
    }
    result.primitive = words[rows * n];
    result.mask = masked ? words[(rows + 1) * n] : 0xffffffffu;
    return result;
  }
  template <typename Visit>
  void for_each_triangle(uint32_t link, const Visit& visit) const {
    for (uint32_t i = 0; i < leaf_size(link); ++i) visit(triangle(link, i));
  }
};

/// The vertices that the triangles in `order` use, in the order of their first use. Returns for
/// each vertex of the mesh its number among them.
std::vector<uint32_t> collect_vertices(const MeshView& mesh, std::span<const uint32_t> order,
                                       BigVector<Vec3>& vertices);

/// Writes the leaf of a link, with the triangles of the same range of `order`. `masks` is needed
/// where the store is masked, `vertex_ids` (see collect_vertices) where it is compact.
void fill_leaf(const MeshView& mesh, std::span<const uint32_t> masks,
               std::span<const uint32_t> vertex_ids, std::span<const uint32_t> order, uint32_t link,
               LeafStore& out);

/// To be called when the bounds are known or have changed.
void prepare_scale(LeafStore& store);

}  // namespace umbel
