// The levels above clusters, built by the surface area heuristic.
#pragma once

#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// Where that is cheaper, replaces the tree above the largest subtrees of at most `most` primitives
/// by a full sweep over them. Returns the root.
Subtree sah_top_levels(BigVector<Merge>& merges, Subtree root, Boxes boxes, uint32_t most,
                       const Config& config);

}  // namespace umbel::bvh
