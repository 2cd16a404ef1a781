// shaders/deform/mesh.glsl for C++: the same structs, byte by byte.
#pragma once

#include <cstdint>

#include "functions.hpp"

namespace sample {

struct GpuMesh {
  VkDeviceAddress rest, positions, source, triangles, source_items, items;
  VkDeviceAddress keys[2], values[2];
  VkDeviceAddress counts, bounds, grid, offsets, boxes;
  uint32_t vertices;
  float time, size;
};

struct GpuMeshPush {
  VkDeviceAddress mesh;
  uint32_t first, count, pass, groups;
};

inline constexpr uint32_t kThreads = 256, kTiles = 16;

static_assert(sizeof(GpuMeshPush) == 24);

}  // namespace sample
