// Makes a wide tree of one with any number of children a node.
#pragma once

#include "bvh/wide/widen.hpp"

namespace umbel {

/// As widen_tree, of a sound tree (bvh::check), whose nodes stay as they are: what has more
/// children than the width has them in nodes of its own.
BvhData widen_kary(const bvh::KaryTree& tree, const MeshView& mesh, const WidenOptions& options,
                   std::span<const uint32_t> masks);

}  // namespace umbel
