// Triangle meshes, as views and as values: validation, welding, rounding, and procedural shapes for
// tests.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "umbel/types.hpp"

namespace umbel {

/// What vertices may have besides the streams of a mesh.
enum class ExtraKind : uint32_t {
  kUvs = 4,        ///< 2 values: the texture coordinates of the set 1, 2, ...
  kJoints = 16,    ///< 4: numbers of joints, whole, at most 2^24; sets 0, 1, ...
  kWeights = 32,   ///< 4: how much the joints of the same set move the vertex
  kMaterial = 64,  ///< 1: what levels of detail keep whose clusters mix materials; set 0
};

struct Extra {
  ExtraKind kind;
  uint32_t set;
  bool operator==(const Extra&) const = default;
};

/// Values that a vertex has for one attribute, and for several together.
UMBEL_API uint32_t extra_width(ExtraKind kind);
UMBEL_API uint32_t extra_width(std::span<const Extra> extras);
inline constexpr uint32_t kMostExtraValues = 40;

/// A triangle mesh that the caller owns. Optional streams are empty or have one element
/// a vertex (`materials`: one a triangle).
struct MeshView {
  std::span<const Vec3> positions;
  std::span<const Triangle> triangles;
  std::span<const Vec3> normals;        ///< unit length where known; zero is legal
  std::span<const Vec4> tangents;       ///< xyz unit length, w = -1 or 1 (glTF)
  std::span<const Vec2> uvs;            ///< first texture coordinate set
  std::span<const Vec4> colors;         ///< linear RGBA in [0, 1]
  std::span<const uint32_t> materials;  ///< material index of each triangle
  /// What `extra_values` hold: for each vertex the values of all of these, in this order, rising by
  /// kind and set, kMostExtraValues at most.
  std::span<const Extra> extras = {};
  std::span<const float> extra_values = {};
};

/// A triangle mesh that owns its arrays.
struct Mesh {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  std::vector<Vec3> normals;
  std::vector<Vec4> tangents;
  std::vector<Vec2> uvs;
  std::vector<Vec4> colors;
  std::vector<uint32_t> materials;
  std::vector<Extra> extras = {};
  std::vector<float> extra_values = {};

  MeshView view() const {
    return {positions, triangles, normals, tangents, uvs, colors, materials, extras, extra_values};
  }
};

/// Throws kInvalidArgument if a stream's length does not fit, and kInvalidMesh naming the
/// first offender if a triangle's index is out of range or a vertex *that a triangle uses*
/// has a NaN or infinite position or attribute, or a joint that is not a whole number. Degenerate
/// and duplicate triangles are legal, and so is anything in vertices that no triangle uses.
UMBEL_API void validate(const MeshView& mesh, const BuildOptions& options = {});

struct DropResult {
  Mesh mesh;
  size_t dropped;  ///< triangles removed
};

/// Removes the triangles that `validate` would reject, and nothing else (vertices stay).
UMBEL_API DropResult drop_invalid(const MeshView& mesh, const BuildOptions& options = {});

/// Merges vertices whose position and attributes are equal and whose triangles have the same
/// material, and removes vertices that no triangle uses. Keeps every triangle, their order and
/// their corner order. Vertices are numbered by first use, so a vertex never has triangles of
/// two materials. -0 equals 0. The mesh must be valid.
UMBEL_API Mesh weld(const MeshView& mesh, const BuildOptions& options = {});

/// For each vertex the lowest index of a vertex at exactly the same position (-0 equals 0).
UMBEL_API std::vector<uint32_t> position_ids(std::span<const Vec3> positions);

/// Rounds every position to a multiple of `step` (> 0, a power of two), so that vertices that
/// are shared stay shared. Returns the largest distance that a vertex moved.
UMBEL_API float snap_to_grid(std::span<Vec3> positions, float step);

struct RoundingLoss {
  double largest_move = 0;  ///< of a vertex that a triangle uses
  uint64_t degenerate = 0;  ///< triangles that have lost their area
};

/// What rounding did to a mesh whose vertices were at `world` and are now at origin + `rounded`.
/// Ignores triangles with an index out of range or a corner that is not finite.
UMBEL_API RoundingLoss rounding_loss(std::span<const Vec3d> world, const Vec3d& origin,
                                     std::span<const Vec3> rounded,
                                     std::span<const Triangle> triangles);

/// The box around the positions that triangles use; empty for an empty mesh.
UMBEL_API Aabb bounds(const MeshView& mesh);

/// The box around each triangle.
UMBEL_API std::vector<Aabb> triangle_boxes(const MeshView& mesh, const BuildOptions& options = {});

/// Order-independent 64-bit digest of the triangles as a set, by position alone (each triangle
/// rotated to a normal form, so corner rotation does not matter but orientation does).
UMBEL_API uint64_t triangle_set_digest(const MeshView& mesh);

/// Procedural meshes, welded and consistently oriented unless said otherwise.
namespace shapes {
UMBEL_API Mesh grid(uint32_t columns, uint32_t rows);       ///< unit square in z = 0
UMBEL_API Mesh sphere(uint32_t subdivisions);               ///< icosphere, 20 * 4^n triangles
UMBEL_API Mesh torus(uint32_t rings, uint32_t sides);       ///< radii 1 and 0.35
UMBEL_API Mesh moebius(uint32_t segments, uint32_t width);  ///< one border, not orientable
UMBEL_API Mesh fan(uint32_t triangles);                     ///< one vertex of that valence
UMBEL_API Mesh soup(uint32_t triangles, uint32_t seed);     ///< random, unconnected
UMBEL_API Mesh tetrahedra(uint32_t count);                  ///< that many closed components
UMBEL_API Mesh terrain(uint32_t columns, uint32_t rows, uint32_t seed);  ///< fractal heights
/// An icosphere displaced by noise along its normals: closed, irregular, any size.
UMBEL_API Mesh blob(uint32_t subdivisions, uint32_t seed);
}  // namespace shapes

}  // namespace umbel
