// The cells of Morton codes for a scene's shape (Vinkler, Bittner & Havran, "Extended Morton Codes
// for High Performance Bounding Volume Hierarchy Construction", 2017): nearly cubes, so the longest
// axis has most bits, and the highest ones. The codes are those of umbel::FrameClusterer, bit by
// bit.
#pragma once

#include <cstdint>
#include <umbel/types.hpp>

namespace sample {

inline constexpr uint32_t kCodeBits = 30;

/// shaders/deform/mesh.glsl has the same.
struct GpuGrid {
  float origin[3], scale[3], last[3];
  float prescale, large;
  uint32_t turn[3];
  uint32_t longest, second, of_all, of_two, longest_first, has_more, large_bit;
};

/// `centers`: the box around the centres of all triangles' boxes.
GpuGrid grid_around(const umbel::Aabb& centers);

}  // namespace sample
