// Last resort where edge collapse goes no further: whole sheets of the surface are left out, or
// exchanged for a few triangles.
//
// A sheet is what hangs together by regular edges. Where nothing of it is locked, leaving it out
// changes the parity of irregular edges alone, which the source explains, so every cut stays sound;
// and a closed surface in its place changes none.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/topology.hpp"

namespace umbel::lod {

struct SheetInput {
  std::span<const uint32_t> position_of;  ///< of vertices
  std::span<const Vec3> positions;        ///< of vertices
  std::span<const uint8_t> locked;        ///< of positions
  std::span<const uint32_t> component;    ///< of positions, see topology.hpp
  std::span<const uint32_t> materials;    ///< of vertices; empty: one
};

/// Leaves out sheets that no locked position touches, the smallest first and never the last one,
/// until at most `target` triangles are left; if that does not help, that one becomes the
/// double-sided triangle of its farthest corners. Returns how far the surface may have moved:
/// the largest diagonal of what went.
float drop_sheets(const SheetInput& input, size_t target, std::vector<Triangle>& triangles);

/// Exchanges sheets that locked positions touch, those of the most triangles first, for flat caps
/// on their borders, until at most `target` triangles are left. A border is a loop of edges with
/// one triangle each that the source does not explain. Returns as drop_sheets does.
float cap_sheets(const SheetInput& input, size_t target, std::vector<Triangle>& triangles);

}  // namespace umbel::lod
