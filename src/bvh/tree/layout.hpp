// Lays a tree out again, depth-first.
#pragma once

#include <cstdint>
#include <vector>

#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// Nodes depth-first, the larger child first, and primitives in the order of the leaves, ascending
/// in each. Inner nodes with a flag become leaves; what repeats below such a node is kept once.
/// `becomes_leaf` has one element a node, or none.
Bvh2 laid_out(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf);

}  // namespace umbel::bvh
