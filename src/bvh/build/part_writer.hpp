// A tree whose subtrees are written to where they belong as soon as all before them are known,
// while they still lie in the cache: nothing else is kept of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "bvh/build/tree_parts.hpp"

namespace umbel::bvh {

/// Builds a part with its nodes before the address. It is called for several at once, from the
/// leftmost on.
using BuildPart = std::function<TreePart(uint32_t part, Node* nodes_end)>;

/// How many nodes there may be.
struct MostNodes {
  size_t part, tree;
};

/// What `join_parts` makes of the parts below `top`, which is empty for a single one.
Bvh2 write_parts(std::span<const TopNode> top, const MostNodes& most,
                 std::vector<uint32_t> primitives, const BuildPart& build);

}  // namespace umbel::bvh
