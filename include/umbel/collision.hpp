// Collision detection: the triangles of two meshes that have a point in common.
//
//   for (const TrianglePair& pair : collide(rock_bvh, ship_bvh)) ...
//
//   CollisionOptions options;
//   options.second_to_first = ship_pose;   // rows of an affine map, no new build
//   if (collides(rock_bvh, ship_bvh, options)) ...
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "umbel/triangle_bvh.hpp"

namespace umbel {

/// Triangle `first` of the first mesh and triangle `second` of the second.
struct TrianglePair {
  uint32_t first, second;
  auto operator<=>(const TrianglePair&) const = default;
};

struct CollisionOptions {
  /// Where the second mesh stands: an affine map as three rows of four, as Transform has them, in
  /// double. Corners are mapped in double and rounded to floats; the identity changes no bit.
  std::array<double, 12> second_to_first{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  uint32_t threads = 0;  ///< most threads to use; 0: all cores
  /// As that of BuildOptions; `collides` reports no fraction.
  std::function<bool(float fraction, std::string_view stage)> progress = {};
};

/// Every pair of triangles that have a point in common, sorted, each once, by a traversal of both
/// hierarchies at once. Decided exactly, without any tolerance, for the corners as floats.
/// Triangles are closed: those that only touch, in a point, along an edge or in one plane, count,
/// and so do degenerate ones. Surfaces collide, not what they enclose: a mesh within another does
/// not. A hierarchy against itself gives each triangle with itself and with its neighbours too.
/// Throws kInvalidArgument for a map that is not finite or brings the second mesh out of the
/// floats' range.
UMBEL_API std::vector<TrianglePair> collide(const Bvh& first, const Bvh& second,
                                            const CollisionOptions& options = {});

/// Whether there is such a pair; stops at the first that is found.
UMBEL_API bool collides(const Bvh& first, const Bvh& second, const CollisionOptions& options = {});

}  // namespace umbel
