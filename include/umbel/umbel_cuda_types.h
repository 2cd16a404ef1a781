// What all C headers of Umbel on CUDA devices share: the twin of cuda_types.hpp, which says what
// holds of pointers, streams, scratch memory and errors. Results are those of umbel_base.h; what
// went wrong is said by umbel_last_error().
#ifndef UMBEL_UMBEL_CUDA_TYPES_H
#define UMBEL_UMBEL_CUDA_TYPES_H

#include "umbel/umbel_base.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A mesh in device memory.
typedef struct umbel_cuda_mesh {
  const void* positions;    ///< three floats a vertex
  size_t position_stride;   ///< bytes from one vertex to the next: a multiple of 4, at least 12
  const uint32_t* indices;  ///< three a triangle
  const uint32_t* items;    ///< the name of each triangle; NULL: its index
  uint32_t triangles;
} umbel_cuda_mesh;

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_CUDA_TYPES_H
