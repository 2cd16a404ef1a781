// Hierarchies of triangles built on CUDA devices, in the form of compact_bvh.hpp. What cuda.hpp
// says of pointers, streams, scratch memory and errors holds here too.
#pragma once

#include <cstddef>
#include <cstdint>

#include "umbel/compact_bvh.hpp"
#include "umbel/cuda.hpp"

namespace umbel::cuda {

/// A tree in arrays of the caller's, on the device.
struct DeviceBvh {
  bvh::CompactNode* nodes;          ///< room for compact_node_capacity(triangles); aligned to 16
  bvh::CompactTriangle* triangles;  ///< one a triangle in leaves; aligned to 16
  bvh::CompactInfo* info;           ///< one
};

}  // namespace umbel::cuda
