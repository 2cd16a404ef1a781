// Rays, closest points and overlaps on CUDA devices, from C: the twin of cuda_trace.hpp, which says
// what everything means. What cuda_types.hpp says of pointers, streams, scratch memory and errors
// holds here too. Trees are built by umbel_cuda_build_bvh.
//
//   umbel_cuda_rays rays = {origins, directions, 12, 12, NULL, NULL, 4, ray_count, 0, 0, NULL};
//   umbel_cuda_hits hits = {t, primitives, NULL};
//   umbel_cuda_intersect(NULL, &bytes, &bvh, &rays, &hits, NULL);
//   cudaMalloc(&scratch, bytes);
//   umbel_cuda_intersect(scratch, &bytes, &bvh, &rays, &hits, stream);
#ifndef UMBEL_UMBEL_CUDA_TRACE_H
#define UMBEL_UMBEL_CUDA_TRACE_H

#include "umbel/umbel_cuda_bvh.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Rays in device memory; strides are bytes from one to the next, multiples of 4.
typedef struct umbel_cuda_rays {
  const void* origins;      ///< three floats a ray
  const void* directions;   ///< three floats a ray
  size_t origin_stride;     ///< at least 12
  size_t direction_stride;  ///< at least 12
  const float* t_min;       ///< one a ray; NULL: 0
  const float* t_max;       ///< one a ray; NULL: infinity
  size_t interval_stride;   ///< of both, at least 4
  uint64_t count;
  uint32_t cull_back_faces;  ///< 1: pass through triangles whose corners run clockwise
  uint32_t mask;             ///< with `masks`: sees triangles whose mask shares a bit with this
  const uint32_t* masks;     ///< one a triangle; NULL: everything is seen
} umbel_cuda_rays;

/// What is NULL is not written.
typedef struct umbel_cuda_hits {
  float* t;              ///< one a ray; infinity where nothing is hit
  uint32_t* primitives;  ///< one a ray; UMBEL_NONE where nothing is hit
  float* uvs;            ///< two a ray
} umbel_cuda_hits;

UMBEL_C_API umbel_result umbel_cuda_intersect(void* scratch, size_t* scratch_bytes,
                                              const umbel_cuda_bvh* bvh,
                                              const umbel_cuda_rays* rays,
                                              const umbel_cuda_hits* hits, void* stream);
/// `results`: one a ray, 1 where it hits anything.
UMBEL_C_API umbel_result umbel_cuda_occluded(void* scratch, size_t* scratch_bytes,
                                             const umbel_cuda_bvh* bvh, const umbel_cuda_rays* rays,
                                             uint8_t* results, void* stream);

/// Points in device memory.
typedef struct umbel_cuda_points {
  const void* points;  ///< three floats each
  size_t stride;       ///< bytes, a multiple of 4, at least 12
  uint64_t count;
  float max_distance;  ///< what is farther away is not found; may be infinite
} umbel_cuda_points;

/// What is NULL is not written.
typedef struct umbel_cuda_closest {
  float* points;         ///< three each
  float* distances;      ///< one each; infinity where nothing is near enough
  uint32_t* primitives;  ///< one each; UMBEL_NONE where nothing is
  float* uvs;            ///< two each
} umbel_cuda_closest;

UMBEL_C_API umbel_result umbel_cuda_closest_points(void* scratch, size_t* scratch_bytes,
                                                   const umbel_cuda_bvh* bvh,
                                                   const umbel_cuda_points* points,
                                                   const umbel_cuda_closest* out, void* stream);

/// Counts, for boxes in device memory; `offsets` has room for one more than boxes.
UMBEL_C_API umbel_result umbel_cuda_count_overlaps(void* scratch, size_t* scratch_bytes,
                                                   const umbel_cuda_bvh* bvh,
                                                   const umbel_aabb* boxes, uint32_t count,
                                                   uint32_t* offsets, void* stream);
/// Lists, after that; `room` is that of `primitives`, for which offsets[count] is enough.
UMBEL_C_API umbel_result umbel_cuda_list_overlaps(void* scratch, size_t* scratch_bytes,
                                                  const umbel_cuda_bvh* bvh,
                                                  const umbel_aabb* boxes, uint32_t count,
                                                  uint32_t* offsets, uint32_t* primitives,
                                                  uint32_t room, void* stream);

#ifdef __cplusplus
}
#endif

#endif
