// Rays, closest points and overlaps of boxes on CUDA devices, by the trees of cuda_bvh.hpp. Part of
// the library umbel::cuda; cuda_types.hpp says what holds of pointers, streams, scratch memory and
// errors.
//
// Answers are those of TriangleQueries over the same triangles, bit by bit: watertight rays (Woop
// et al. 2013) for coordinates from 1e-15 to 1e15, of hits at the same t the lowest primitive, of
// points at the same distance too. Trees and queries are read on the device, so a captured graph
// follows whatever is written there, but for numbers of queries.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "umbel/cuda_bvh.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::cuda {

/// Rays in device memory, any number of them. Strides are bytes from one to the next, multiples of
/// 4; so an array of Ray will do as well as arrays of three floats each.
struct DeviceRays {
  const void* origins = nullptr;     ///< three floats a ray
  const void* directions = nullptr;  ///< three floats a ray; any length but 0
  size_t origin_stride = 12, direction_stride = 12;
  const float* t_min = nullptr;  ///< one a ray; null: 0
  const float* t_max = nullptr;  ///< one a ray; null: infinity
  size_t interval_stride = 4;    ///< of both
  uint64_t count = 0;
  bool cull_back_faces = false;  ///< pass through triangles whose corners run clockwise
  uint32_t mask = 0xffffffffu;   ///< sees triangles whose mask shares a bit with this
  /// In device memory, one a triangle, by the number that hits name it with; null: all bits set.
  const uint32_t* masks = nullptr;
};

/// Where rays hit: see Hit. What is null is not written.
struct DeviceHits {
  float* t = nullptr;              ///< one a ray; infinity where nothing is hit
  uint32_t* primitives = nullptr;  ///< one a ray; kNone where nothing is hit
  float* uvs = nullptr;            ///< two a ray
};

/// The nearest hit of each ray.
UMBEL_API void intersect_rays(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                              const DeviceRays& rays, const DeviceHits& hits,
                              Stream stream = nullptr);
/// Whether each ray hits anything: 1 or 0.
UMBEL_API void occluded_rays(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                             const DeviceRays& rays, uint8_t* results, Stream stream = nullptr);

/// Points in device memory.
struct DevicePoints {
  const void* points = nullptr;  ///< three floats each
  size_t stride = 12;            ///< bytes, a multiple of 4
  uint64_t count = 0;
  float max_distance = std::numeric_limits<float>::infinity();
};

/// The nearest points of the surface: see ClosestPoint. What is null is not written.
struct DeviceClosest {
  float* points = nullptr;         ///< three each
  float* distances = nullptr;      ///< one each; infinity where nothing is near enough
  uint32_t* primitives = nullptr;  ///< one each; kNone where nothing is
  float* uvs = nullptr;            ///< two each
};

UMBEL_API void closest_points(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                              const DevicePoints& points, const DeviceClosest& out,
                              Stream stream = nullptr);

/// How many triangles touch each box, exactly, as sums: offsets[i + 1] - offsets[i] for box i.
/// Where the tree has triangles in several leaves (DeviceBvhConfig::presplit) they may be counted
/// repeatedly. All together there must be fewer than 2^32.
UMBEL_API void count_overlaps(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                              const Aabb* boxes, uint32_t count, uint32_t* offsets,
                              Stream stream = nullptr);
/// Lists them, after count_overlaps: box i touches primitives[offsets[i] .. offsets[i + 1]),
/// ascending, each once; so offsets may become smaller. `room` is that of `primitives`, which
/// offsets[count] is enough for; beyond it nothing is written, and of what is left out nothing is
/// counted.
UMBEL_API void list_overlaps(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                             const Aabb* boxes, uint32_t count, uint32_t* offsets,
                             uint32_t* primitives, uint32_t room, Stream stream = nullptr);

}  // namespace umbel::cuda
