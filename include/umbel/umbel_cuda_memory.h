// Memory of CUDA devices and what streams are doing, from C: the twin of cuda_memory.hpp, which
// says what everything means.
#ifndef UMBEL_UMBEL_CUDA_MEMORY_H
#define UMBEL_UMBEL_CUDA_MEMORY_H

#include "umbel/umbel_cuda_types.h"

#ifdef __cplusplus
extern "C" {
#endif

UMBEL_C_API umbel_result umbel_cuda_allocate(size_t bytes, void** memory);
UMBEL_C_API umbel_result umbel_cuda_free(void* memory);
/// Waits for the copy.
UMBEL_C_API umbel_result umbel_cuda_copy(void* to, const void* from, size_t bytes, void* stream);
/// `place` may be NULL.
UMBEL_C_API umbel_result umbel_cuda_wait(void* stream, const void* place);
/// 1 or 0. `place` may be NULL.
UMBEL_C_API umbel_result umbel_cuda_is_captured(void* stream, const void* place, int* captured);

#ifdef __cplusplus
}
#endif

#endif  // UMBEL_UMBEL_CUDA_MEMORY_H
