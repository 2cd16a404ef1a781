// Makes a wide tree of a binary one.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "bvh/wide/triangle_bvh_data.hpp"

namespace umbel {

struct WidenOptions {
  uint32_t width = 8;
  bool compact = false;  ///< vertices shared, boxes quantised
  // What the build of the tree guarantees need not be checked.
  bool is_valid = false;   ///< the tree's triangles have indices in range and finite corners
  bool may_repeat = true;  ///< a triangle may be in several leaves
};

inline constexpr uint32_t kMaxWidth = 8;

/// Of a node's children. Those that are not there have boxes that lie nowhere.
using ChildBoxes = std::array<Aabb, kMaxWidth>;
inline constexpr ChildBoxes kNoBoxes = [] {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  ChildBoxes boxes;
  boxes.fill({{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}});
  return boxes;
}();

/// Divides `count` primitives evenly among the children of a node, into leaves or into subtrees of
/// full leaves: visit(slot, offset, count, is_leaf).
template <typename Visit>
void divide_run(uint32_t count, uint32_t width, const Visit& visit) {
  uint32_t part = kMaxLeafTriangles;
  while (uint64_t{part} * width < count) part *= width;
  for (uint32_t slot = 0; slot * part < count; ++slot)
    visit(slot, slot * part, std::min(part, count - slot * part), part == kMaxLeafTriangles);
}

/// Throws kInvalidMesh for an index out of range, or a corner that is not finite, in one of these
/// triangles.
void check_triangles(const MeshView& mesh, std::span<const uint32_t> triangles);

/// Throws kUnsupported for more nodes than links can tell apart.
void check_size(const BvhData& data);

/// What a wide tree says of itself before it has nodes.
BvhData empty_tree(const MeshView& mesh, const WidenOptions& options,
                   std::span<const uint32_t> masks);

/// `tree` is sound (bvh::check) and over the triangles of `mesh`; `masks` is empty or one a
/// triangle. Throws kInvalidMesh for an index out of range in a triangle of the tree. The result
/// does not depend on the number of threads. Leaves costs and kernels to the caller.
BvhData widen_tree(const bvh::Bvh2& tree, const MeshView& mesh, const WidenOptions& options,
                   std::span<const uint32_t> masks);

}  // namespace umbel
