// The first pass over the input: what all later ones need to know of the whole.
#pragma once

#include <cstdint>
#include <limits>

#include "io/source/triangle_source.hpp"
#include "scale/point_rule.hpp"

namespace umbel::scale {

/// Of any part of a source. Parts may be summarised apart and merged in any order.
struct SourceSummary {
  uint64_t triangles = 0;
  Vec3d low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};
  bool exact = true;         ///< floats hold every coordinate
  uint64_t fingerprint = 0;  ///< of the triangles and their order, whatever the blocks
  uint32_t largest_material = 0;
  Vec2 least_uv{kLargest, kLargest}, largest_uv{-kLargest, -kLargest};

  void merge(const SourceSummary& other);

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  static constexpr float kLargest = std::numeric_limits<float>::max();
};

/// Of the triangles [begin, end).
SourceSummary summarise(const io::TriangleSource& source, uint64_t begin, uint64_t end);

/// Where positions are relative to, as for a mesh in memory: zero where floats hold every
/// coordinate, or the box lies within 16 times half its extent of zero; else the box's middle,
/// rounded to a multiple of a power of two of at most its longest side.
Vec3d choose_origin(const SourceSummary& summary);

/// The box of all positions.
Aabb box_of(const SourceSummary& summary, const PointRule& rule);

}  // namespace umbel::scale
