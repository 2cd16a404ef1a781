// Reinsertion with a choice of how much of the tree a round tries to move.
#pragma once

#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// The part of a tree's nodes, the largest, that a round looks at first.
inline constexpr float kReinserted = 0.1f;
/// That of a tree built by SAH, where only the largest gain much.
inline constexpr float kReinsertedOfGood = 0.04f;

void reinsert(Bvh2& tree, uint32_t rounds, float fraction, const BuildOptions& options);

}  // namespace umbel::bvh
