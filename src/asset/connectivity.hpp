// The triangles of a cluster as few bits: a walk over them from edge to edge, in the manner of
// Edgebreaker (Rossignac, "Edgebreaker: Connectivity Compression for Triangle Meshes", 1999).
// docs/format.md has every bit.
//
// The walk starts at a triangle and passes *gates*: directed edges with a triangle on the far side
// that was not visited. A gate (a, b) leads to the triangle (a, b, c); c is new, or the far end of
// an open gate beside this one, or named. Each of the other two edges closes an open gate, or is a
// gate itself, or lies on the border. What c is and whether the edges are gates is one symbol of a
// fixed prefix code. Vertices are numbered in the order of the walk. Any triangles can be coded,
// whatever their edges share; smooth surfaces take about 2.6 bits each.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/bits.hpp"

namespace umbel::asset {

inline constexpr uint32_t kMaxLocal = 256;  ///< triangles and vertices of a cluster

/// Three earlier vertices from which a vertex is predicted: a and b, the ends of the gate that led
/// to it, and the third vertex of the triangle across that gate. All are the vertex before where a
/// walk starts; those of vertex 0 are 0.
struct Parents {
  uint8_t a, b, across;
};

/// An edge of one triangle that the walk found no other triangle at, in the walk's numbers.
struct BorderEdge {
  uint8_t from, to;
};

/// What the walk makes of a cluster.
struct Walk {
  std::vector<uint8_t> triangles;  ///< in the order of the walk, in the walk's numbers
  std::vector<uint8_t> vertices;  ///< by their new numbers, the old ones; those of no triangle last
  std::vector<Parents> parents;   ///< of each vertex, in new numbers
  std::vector<BorderEdge> border;
};

/// Writes triangles, triples of vertices < `vertices` <= 256.
Walk encode_triangles(std::span<const uint8_t> triangles, uint32_t vertices, BitWriter& out);

/// At most all edges of a cluster, and a place for one that is none.
using BorderEdges = std::array<BorderEdge, size_t{3} * kMaxLocal + 1>;

/// Reads `triangles.size() / 3` <= 256 triangles of `parents.size()` <= 256 vertices, and each
/// vertex's parents. Returns how many border edges it found. Throws kCorrupt if a number is out of
/// range.
uint32_t decode_triangles(BitReader& in, std::span<uint8_t> triangles, std::span<Parents> parents,
                          BorderEdges& border);

}  // namespace umbel::asset
