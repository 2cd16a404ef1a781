// One unit's part of the input: what routing gives to the unit builder at the finest level.
//
// A unit is a part of space with at most some number of triangles. Units are built one by one, in
// any order, by any process, and know each other only by the bits of the positions that they share.
#pragma once

#include <cstdint>
#include <vector>

#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel::scale {

struct UnitInput {
  /// Welded within the unit, vertices numbered by first use, triangles in the order of the source.
  /// Positions are relative to the origin that all units share; a position that two units have is
  /// the same in both, bit for bit, and none is -0. All units have the same streams: those that any
  /// part of the source has. `materials` is one a triangle, or empty in all units.
  Mesh mesh;
  /// One a vertex: 1 where another unit may have the vertex's position too. Every vertex at one
  /// position has the same. Too many are allowed, too few are not.
  std::vector<uint8_t> frozen;
  /// Around all triangles of all units: everything that depends on the mesh's size depends on this.
  Aabb box;
};

}  // namespace umbel::scale
