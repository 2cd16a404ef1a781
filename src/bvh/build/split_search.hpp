// The search for the cheapest split of references to triangles: an object split, by centroids, or a
// spatial split, by a plane that clips them.
#pragma once

#include <bit>
#include <cstdint>

#include "base/simd/box4.hpp"
#include "umbel/mesh.hpp"

namespace umbel::bvh {

/// In the tag of a reference, beside its triangle: it is only a part of the triangle.
inline constexpr uint32_t kIsPart = 0x80000000u;

// A reference is a box whose fourth lanes hold its tag, half of it each, as ordinary floats:
// arithmetic on them must not meet denormals.
inline Box4 tagged(const Box4& untagged, uint32_t tag) {
  Box4 box = untagged;
  box.low[3] = std::bit_cast<float>(0x40000000u | (tag & 0xffffu));
  box.negated_high[3] = std::bit_cast<float>(0x40000000u | tag >> 16);
  return box;
}
inline uint32_t tag_of_reference(const Box4& reference) {
  return (std::bit_cast<uint32_t>(reference.low[3]) & 0xffffu) |
         std::bit_cast<uint32_t>(reference.negated_high[3]) << 16;
}
inline uint32_t triangle_of(const Box4& reference) {
  return tag_of_reference(reference) & ~kIsPart;
}

struct NodeBounds {
  Box4 box;
  Box4 centers;  ///< of doubled centres
  Float4 pad;    ///< of `box`
};

/// Splits are in bins of a grid; costs are areas times counts.
// NOLINTNEXTLINE(clang-analyzer-optin.performance.Padding): there is one at a time
struct Split {
  float cost = std::numeric_limits<float>::infinity();
  bool is_spatial = false;
  int axis = -1;             ///< -1: nothing tells the references apart
  uint32_t mask = 0;         ///< bit i: reference i goes left. 0: by bins
  uint32_t bin = 0;          ///< the first one on the right
  Float4 origin{}, scale{};  ///< of the bins
  float plane = 0;           ///< of a spatial split
  float left_area = 0, right_area = 0;
  float overlap = 0;  ///< area of what both sides cover, of a partition
  Box4 left_box{}, right_box{};
  uint32_t left_count = 0, right_count = 0;
};

/// The left half in place, the right one in this thread's scratch memory.
struct Halves {
  uint32_t left_count, right_count;
  const Box4* right;
};

NodeBounds bounds_of(const Box4* references, uint32_t count);
Split best_partition(const Box4* references, uint32_t count, const NodeBounds& bounds);
Split best_spatial_split(const Box4* references, uint32_t count, const NodeBounds& bounds,
                         const MeshView& mesh);

/// Neither half is empty.
Halves partition_references(Box4* references, uint32_t count, const Split& split);
/// Adds at most `spare` references. Neither half is empty.
Halves split_references(Box4* references, uint32_t count, uint32_t spare, const Split& split,
                        const MeshView& mesh);
const Box4* copy_to_scratch(const Box4* references, uint32_t count);

}  // namespace umbel::bvh
