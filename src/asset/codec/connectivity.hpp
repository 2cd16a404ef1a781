// Codes a cluster's triangles in few bits: a traversal from triangle to triangle across edges, in
// the manner of Edgebreaker (Rossignac, "Edgebreaker: Connectivity Compression for Triangle
// Meshes", 1999). docs/format.md has every bit.
//
// The traversal keeps a queue of *active edges*: directed edges with an unvisited triangle on the
// far side. An active edge (a, b) leads to the triangle (a, b, c), where c is new, or the far end
// of an open active edge beside this one, or named by its number. Each of the other two edges
// closes an open active edge, becomes active itself, or lies on the border. One symbol of a fixed
// prefix code tells what c is and what becomes of the two edges. Vertices are numbered in the order
// of the traversal. Any triangles can be coded, whatever their edges share; smooth surfaces take
// about 2.6 bits a triangle.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/bits.hpp"

namespace umbel::asset {

inline constexpr uint32_t kMaxLocal = 256;  ///< triangles and vertices of a cluster

/// Three earlier vertices that predict a vertex: a and b, the ends of the active edge that led to
/// it, and the third vertex of the triangle on the known side. All three are the previous vertex
/// where a traversal starts; those of vertex 0 are 0.
struct Predictors {
  /// A flag of the last of three vertices in a row that a traversal starts with.
  static constexpr uint32_t kCloses = 1u << 24;

  uint32_t word;  ///< a, b, across and the flag, from the lowest byte on

  uint32_t a() const { return word & 0xff; }
  uint32_t b() const { return word >> 8 & 0xff; }
  uint32_t across() const { return word >> 16 & 0xff; }
  bool closes_triangle() const { return (word & kCloses) != 0; }
};
constexpr Predictors predictors_of(uint32_t a, uint32_t b, uint32_t across) {
  return {a | b << 8 | across << 16};
}

/// An edge with a triangle on one side only, in the numbers of the traversal.
struct BorderEdge {
  uint8_t from, to;
};

/// A cluster in the order of its traversal.
struct Traversal {
  std::vector<uint8_t> triangles;      ///< in that order, of the new vertex numbers
  std::vector<uint8_t> vertices;       ///< by new number, the old one; those of no triangle last
  std::vector<Predictors> predictors;  ///< of each vertex, in new numbers
  std::vector<BorderEdge> border;
};

/// Writes triangles, triples of vertices < `vertices` <= 256. `values` are what the vertices'
/// integers will be, as many for each, or empty: they say in which order regions take few bits.
Traversal encode_triangles(std::span<const uint8_t> triangles, uint32_t vertices,
                           std::span<const int32_t> values, BitWriter& out);

/// Links of border edges by vertex: the end of the last one that starts there, and the start of the
/// last one that ends there. Linked vertices are stored as `first` plus their number.
struct BorderLinks {
  uint32_t* next;
  uint32_t* previous;
  uint32_t first;
};

/// Reads `triangles.size() / 3` <= 256 triangles of `predictors.size()` <= 256 vertices, and each
/// vertex's predictors. `border` has room for all vertices. Throws kCorrupt if a number is out of
/// range. `version` is that of the file format.
void decode_triangles(uint32_t version, BitReader& in, std::span<uint8_t> triangles,
                      std::span<Predictors> predictors, BorderLinks border);

}  // namespace umbel::asset
