// Quantises a cluster's vertices to integers and codes these in few bits: the parallelogram rule
// (Touma & Gotsman, "Triangle Mesh Compression", 1998) predicts each component from the adjacent
// triangle, and the residual is Rice-coded. docs/format.md has every bit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "asset/codec/connectivity.hpp"
#include "base/bits.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::asset {

enum Attributes : uint32_t {
  kPositions = 0,
  kNormals = 1,
  kTangents = 2,
  kUvs = 4,
  kColors = 8,
  kJoints = 16,
  kWeights = 32,
  kMaterial = 64
};

/// How an attribute's values become integers.
enum class Coding : uint32_t {
  kFloats = 0,      ///< the bits of each float, so that order is kept; nothing is lost
  kGrid = 1,        ///< multiples of `step`
  kOctahedral = 2,  ///< unit vectors, two components of `bits` bits
  kAngle = 3,       ///< tangents: `bits` bits of angle about the normal, and the side
  kSrgb = 4,        ///< linear colours in [0, 1]: `bits` bits of sRGB and of alpha
};

struct AttributeFormat {
  uint32_t attribute;
  Coding coding;
  uint32_t bits;
  float step;
  uint32_t set = 0;         ///< for attributes that may be there several times
  uint16_t components = 0;  ///< integers a vertex; 0: those of the coding
  uint16_t is_smooth = 0;   ///< predicted by the mean, not the parallelogram
};

/// All attributes of a mesh, positions first, then as their flags and sets rise. Those that this
/// version does not know have components, which are decoded and left.
struct VertexFormat {
  std::vector<AttributeFormat> attributes;
  std::vector<uint8_t> is_smooth;  ///< by component
};

inline constexpr uint32_t kMaxAttributes = 32, kMaxComponents = 64;

/// Whether this version can decode the attribute.
bool is_known(const AttributeFormat& attribute);
/// Fills in components and prediction where they are left open. Throws kCorrupt if a file could
/// not have it.
VertexFormat make_format(std::vector<AttributeFormat> attributes);
uint32_t components(const VertexFormat& format);
/// From one decoded vertex's integers to the next's: a multiple of four, for vector instructions.
uint32_t row_stride(const VertexFormat& format);

/// `components(format)` integers a vertex, in the order of `vertices`, indices into the streams.
void quantize(const VertexFormat& format, const Mesh& streams, std::span<const uint32_t> vertices,
              std::span<int32_t> out);
/// The streams of a cluster, whose vertices are row_stride(format) apart; its triangles are left
/// alone.
void dequantize(const VertexFormat& format, std::span<const int32_t> integers,
                lod::ClusterGeometry& geometry);

/// The range of a component in a group: first vertices of clusters are stored relative to `lowest`.
struct ComponentRange {
  int32_t lowest;
  uint32_t bits;  ///< <= 32
};

/// The triangles of a cluster, which are read before its vertices.
struct ClusterTriangles {
  std::span<const Predictors> predictors;  ///< of each vertex
  std::span<const uint8_t> triangles;      ///< in the numbers of the traversal
};

/// What earlier vertices of the group tell of a cluster's, which may themselves be of the cluster.
struct KnownVertices {
  /// The vertex of an earlier cluster that each equals, or kNone.
  std::span<const uint32_t> equal;
  /// The earlier vertex at the position of each that has no equal, or kNone; to the decoder, none
  /// at all if the cluster has no twins.
  std::span<const uint32_t> twin;
};

/// Writes the vertices from `first` to the last of `group`, the integers of the group's vertices,
/// components(format) apart, in the order of the traversal: those without an equal.
void encode_vertices(const VertexFormat& format, std::span<const int32_t> group, uint32_t first,
                     const ClusterTriangles& cluster, const KnownVertices& known,
                     std::span<const ComponentRange> ranges, BitWriter& out);
/// Reads them into `group`, the integers of the group's vertices, row_stride(format) apart, from
/// its vertex `first` on, as version 4 of the file format has them or later ones.
void decode_vertices(uint32_t version, const VertexFormat& format, const ClusterTriangles& cluster,
                     const KnownVertices& known, std::span<const ComponentRange> ranges,
                     BitReader& in, std::span<int32_t> group, uint32_t first);
/// Reads those of version 3 of the file format, which has no twins.
void decode_vertices_3(const VertexFormat& format, std::span<const Predictors> predictors,
                       std::span<const uint32_t> equal, std::span<const ComponentRange> ranges,
                       BitReader& in, std::span<int32_t> group, uint32_t first);

}  // namespace umbel::asset
