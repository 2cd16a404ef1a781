// shaders/scene.glsl for C++: the same structs, byte by byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <umbel/types.hpp>

#include "functions.hpp"

namespace sample {

struct GpuNode {
  umbel::Vec3 center;
  float radius, error;
  uint32_t group, first_child, children;
};

struct GpuGroup {
  umbel::Vec3 center;
  float radius, error;
  uint32_t first_cluster, clusters, page;
};

struct GpuCluster {
  umbel::Vec3 low, high;
  uint32_t group, generating_group, words, vertices, triangles;
};

struct GpuInstance {
  std::array<float, 12> rows;
  umbel::Vec3 eye;
  float threshold;
  std::array<umbel::Vec4, 5> planes;
};

struct GpuItem {
  uint32_t instance, index;
};

inline constexpr uint32_t kMostLayers = 32;
inline constexpr uint32_t kRow = 128;

struct GpuCounts {
  std::array<std::array<uint32_t, 4>, kMostLayers> layers{};
  std::array<std::array<uint32_t, 4>, 2> mesh_draw{}, draw{};
  std::array<uint32_t, 4> hidden{};
  uint32_t overflow = 0;
};

struct GpuFrame {
  std::array<float, 16> clip_from_world, last_clip_from_world;  // by columns
  umbel::Vec4 eye;
  VkDeviceAddress nodes, groups, clusters, instances, pool, first_word, usable, wanted, queue,
      visible, hidden, pyramid, counts, rays;
  uint32_t capacity, occlusion;
  std::array<uint32_t, 2> size;
};

// What only a traced picture needs.
struct GpuRays {
  VkDeviceAddress scene, clusters, picture;
  umbel::Vec3 right, up, forward, sun;
  umbel::Vec4 background;
  VkDeviceAddress positions, triangles, offsets;  // of a deforming mesh
};

struct GpuPush {
  VkDeviceAddress frame;
  uint32_t layer, pass;
};
inline constexpr uint32_t kPushBytes = 16;

static_assert(sizeof(GpuNode) == 32 && sizeof(GpuGroup) == 32 && sizeof(GpuCluster) == 44);
static_assert(sizeof(GpuInstance) == 144 && sizeof(GpuItem) == 8);
static_assert(offsetof(GpuFrame, capacity) == 256 && sizeof(GpuRays) == 112);

}  // namespace sample
