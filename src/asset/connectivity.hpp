// The triangles of a cluster as few bits: a walk over them from edge to edge, in the manner of
// Edgebreaker (Rossignac, "Edgebreaker: Connectivity Compression for Triangle Meshes", 1999).
// docs/format.md has every bit.
//
// The walk starts at a triangle and passes *gates*: directed edges with a triangle on the far side
// that was not visited. A gate (a, b) leads to the triangle (a, b, c); c is new, or the far end of
// an open gate beside this one, or named. Each of the other two edges closes an open gate, or gets
// a bit that says whether it is a gate itself. Vertices are numbered in the order of the walk.
// Any triangles can be coded, whatever their edges share; smooth surfaces take about 3.3 bits each.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/bits.hpp"

namespace umbel::asset {

/// Three earlier vertices from which a vertex is predicted: a and b, the ends of the gate that led
/// to it, and the third vertex of the triangle across that gate. All are the vertex before where a
/// walk starts; those of vertex 0 are 0.
struct Parents {
  uint8_t a, b, across;
};

/// What the walk makes of a cluster.
struct Walk {
  std::vector<uint8_t> triangles;  ///< in the order of the walk, in the walk's numbers
  std::vector<uint8_t> vertices;  ///< by their new numbers, the old ones; those of no triangle last
  std::vector<Parents> parents;   ///< of each vertex, in new numbers
};

/// Writes triangles, triples of vertices < `vertices` <= 256.
Walk encode_triangles(std::span<const uint8_t> triangles, uint32_t vertices, BitWriter& out);

/// Reads `triangles.size() / 3` triangles of `parents.size()` <= 256 vertices, and each vertex's
/// parents. Throws kCorrupt if a number is out of range.
void decode_triangles(BitReader& in, std::span<uint8_t> triangles, std::span<Parents> parents);

}  // namespace umbel::asset
