// A last resort where edge collapse goes no further: whole manifold patches are removed, or
// replaced by a few triangles.
//
// A patch is what manifold edges connect. Where nothing of it is locked, removing it changes the
// parity of non-manifold edges alone, which the source allows, so every cut stays sound; and a
// closed surface in its place changes none.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/topology.hpp"

namespace umbel::lod {

struct PatchInput {
  std::span<const uint32_t> position_of;  ///< of vertices
  std::span<const Vec3> positions;        ///< of vertices
  std::span<const uint8_t> locked;        ///< of positions
  std::span<const uint32_t> component;    ///< of positions, see topology.hpp
  std::span<const uint32_t> materials;    ///< of vertices; empty: one
};

/// Leaves out patches that no locked position touches, the smallest first and never the last one,
/// until at most `target` triangles are left; if that does not help, that one becomes the
/// double-sided triangle of its farthest corners. Returns how far the surface may have moved:
/// the largest diagonal of what went.
float remove_patches(const PatchInput& input, size_t target, std::vector<Triangle>& triangles);

/// Exchanges patches that locked positions touch, those of the most triangles first, for flat caps
/// on their borders, until at most `target` triangles are left. A border is a loop of edges with
/// one triangle each that the source does not allow. Returns as remove_patches does.
float cap_patches(const PatchInput& input, size_t target, std::vector<Triangle>& triangles);

}  // namespace umbel::lod
