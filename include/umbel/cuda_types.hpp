// What all headers of Umbel on CUDA devices share, and what holds of all their functions. They are
// part of the library umbel::cuda, which is built with UMBEL_CUDA.
//
// - All pointers but `scratch_bytes` are to memory of the device, aligned as their types are. Where
//   it comes from does not matter: cudaMalloc, PyTorch, CuPy, or a buffer of Vulkan or Direct3D
//   that was imported by cudaImportExternalMemory.
// - Every function puts its work into `stream` and returns; none allocates, and unless its header
//   says so none waits, so all can be captured in a graph, which may be replayed for new values in
//   the same memory.
// - Scratch memory is asked for by size first, as with CUB: with `scratch` null a function sets
//   `scratch_bytes` alone, which depends on nothing but sizes and the config, and reads no other
//   pointer. Otherwise `scratch` must be aligned to 256 bytes and have that many. Calls on the same
//   stream may share it.
// - Values of positions and indices are not checked: an index must be below the number of vertices.
// - Errors throw umbel::Error: kInvalidArgument, kUnsupported, or kDevice with CUDA's own words.
#pragma once

#include <cstddef>
#include <cstdint>

#include "umbel/types.hpp"

// NOLINTNEXTLINE(readability-identifier-naming): CUDA names it so.
struct CUstream_st;

namespace umbel::cuda {

/// A cudaStream_t; null is the default stream.
using Stream = CUstream_st*;

/// A mesh in device memory.
struct DeviceMesh {
  const void* positions;        ///< three floats a vertex
  size_t position_stride = 12;  ///< bytes from one vertex to the next: a multiple of 4, at least 12
  const uint32_t* indices;      ///< three a triangle
  const uint32_t* items = nullptr;  ///< the name of each triangle; null: its index
  uint32_t triangles = 0;
};

}  // namespace umbel::cuda
