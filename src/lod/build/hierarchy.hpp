// The selection hierarchy over groups.
#pragma once

#include <vector>

#include "umbel/lod/types.hpp"

namespace umbel::lod {

/// One tree over per-level trees over the groups of `tables.levels`: nodes[0] is the root, the
/// children of a node are consecutive, and every group is one leaf with its own sphere and
/// error. Empty without groups. Uses levels and groups alone.
std::vector<Node> build_hierarchy(const Tables& tables);

/// A sphere and an error for a node such that whenever its error is not too large for a view,
/// no child's is, to the last bit of the arithmetic in refine.hpp.
Node enclosing_node(const Node* children, size_t count);

}  // namespace umbel::lod
