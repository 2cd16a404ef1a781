// Every leaf of a TriangleBvh whose boxes pass a test, in no particular order.
#pragma once

#include <array>

#include "bvh/triangle_bvh_data.hpp"

namespace umbel {

/// Deepest tree there is: 255 levels of Config::max_depth, and those of leaves of up to 255
/// triangles that had to be cut up.
inline constexpr uint32_t kMaxWalkDepth = 288;

/// A node's boxes, one array a plane.
template <uint32_t kWidth>
struct NodeBoxes {
  const float* planes;
  const float* min_x() const { return planes; }
  const float* max_x() const { return planes + kWidth; }
  const float* min_y() const { return planes + 2 * kWidth; }
  const float* max_y() const { return planes + 3 * kWidth; }
  const float* min_z() const { return planes + 4 * kWidth; }
  const float* max_z() const { return planes + 5 * kWidth; }
};

/// `test(NodeBoxes<kWidth>, uint32_t* passes)` sets passes[slot] for each slot, whatever for those
/// without a child; `leaf(link)` takes what passed.
template <uint32_t kWidth, typename Test, typename Leaf>
void walk_leaves(const TriangleBvhData& data, const Test& test, const Leaf& leaf) {
  if (data.nodes.empty()) return;
  std::array<uint32_t, kMaxWalkDepth*(kWidth - 1) + 1> stack;
  size_t waiting = 0;
  stack[waiting++] = 0;
  while (waiting > 0) {
    const uint32_t* words = data.nodes.data() + size_t{stack[--waiting]} * (7 * kWidth);
    uint32_t passes[kWidth];
    test(NodeBoxes<kWidth>{reinterpret_cast<const float*>(words)}, passes);
    for (uint32_t slot = 0; slot < kWidth; ++slot) {
      const uint32_t link = words[6 * kWidth + slot];
      if (!passes[slot] || link == kNoChild) continue;
      if (TriangleBvhData::is_leaf(link))
        leaf(link);
      else
        stack[waiting++] = link;
    }
  }
}

/// Calls body(std::integral_constant<uint32_t, width>) for the data's width.
template <typename Body>
decltype(auto) with_width(const TriangleBvhData& data, const Body& body) {
  switch (data.width) {
    case 2:
      return body(std::integral_constant<uint32_t, 2>());
    case 4:
      return body(std::integral_constant<uint32_t, 4>());
    default:
      return body(std::integral_constant<uint32_t, 8>());
  }
}

}  // namespace umbel
