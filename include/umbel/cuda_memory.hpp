// Memory of CUDA devices, for callers that have no library of their own for it, and what a stream
// is doing. Part of the library umbel::cuda.
#pragma once

#include "umbel/cuda_types.hpp"

namespace umbel::cuda {

/// Memory of the current device, aligned to 256 bytes; never null. cudaMalloc, which may wait.
UMBEL_API void* device_allocate(size_t bytes);
/// Waits for all work that may use it. Null is allowed.
UMBEL_API void device_free(void* memory) noexcept;
/// Copies between the host and a device, or on a device, behind what is in the stream, and waits.
UMBEL_API void device_copy(void* to, const void* from, size_t bytes, Stream stream = nullptr);
/// Waits for the stream. `place`: memory of its device, which matters for the default stream only.
UMBEL_API void wait_for(Stream stream, const void* place = nullptr);
/// Whether a graph is being captured from the stream.
UMBEL_API bool is_captured(Stream stream, const void* place = nullptr);

}  // namespace umbel::cuda
