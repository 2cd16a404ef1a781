// Which nodes of a binary tree become the children of a wide one: of all ways the one with the
// least expected cost, by dynamic programming (Ylitie, Karras & Laine, "Efficient Incoherent Ray
// Traversal on GPUs Through Compressed Wide BVHs", 2017). Leaves of up to 8 triangles cost little
// more than leaves of one, so subtrees become leaves where that is cheaper than to traverse them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "bvh/wide/widen.hpp"

namespace umbel {

/// A subtree of more primitives than fit a leaf; how many more does not matter.
inline constexpr uint8_t kTooMany = kMaxLeafTriangles + 1;

using ChildShares = std::array<uint8_t, kMaxWidth>;

/// For one binary node: how best to make 1, 2, ... width children of its subtree.
struct WidePlan {
  /// [i - 1]: how many of i go to the left; 0: as for i - 1. [0]: how many of the node's own width.
  ChildShares left_share;
  uint8_t primitives;  ///< below, at most kTooMany
  uint8_t parts;       ///< binary leaves below, at most kMaxWidth: there cannot be more children
  bool is_leaf;        ///< one child of it is a leaf
};

class WidePlans {
 public:
  WidePlans(const bvh::Bvh2& tree, uint32_t width);
  /// The plan of a binary node.
  const WidePlan& operator[](uint32_t node) const { return plans_[node]; }

 private:
  std::unique_ptr<WidePlan[]> plans_;
};

}  // namespace umbel
