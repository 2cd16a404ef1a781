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
  uint32_t word;  ///< a, b and across, from the lowest byte on

  uint32_t a() const { return word & 0xff; }
  uint32_t b() const { return word >> 8 & 0xff; }
  uint32_t across() const { return word >> 16; }
};
constexpr Parents parents_of(uint32_t a, uint32_t b, uint32_t across) {
  return {a | b << 8 | across << 16};
}

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

/// Where border edges are noted: for each vertex, the end of the last that begins there, and the
/// beginning of the last that ends there. What is noted of a vertex is its number and `first`.
struct BorderLinks {
  uint32_t* next;
  uint32_t* previous;
  uint32_t first;
};

/// Reads `triangles.size() / 3` <= 256 triangles of `parents.size()` <= 256 vertices, and each
/// vertex's parents. `border` has room for all vertices. Throws kCorrupt if a number is out of
/// range.
void decode_triangles(BitReader& in, std::span<uint8_t> triangles, std::span<Parents> parents,
                      BorderLinks border);

}  // namespace umbel::asset
