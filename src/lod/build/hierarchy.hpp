// The nodes of the selection hierarchy; lod/types.hpp has build_hierarchy.
#pragma once

#include <cstddef>

#include "umbel/lod/types.hpp"

namespace umbel::lod {

/// A sphere and an error for a node such that whenever its error is not too large for a view,
/// no child's is, to the last bit of the arithmetic in refine.hpp.
Node enclosing_node(const Node* children, size_t count);

}  // namespace umbel::lod
