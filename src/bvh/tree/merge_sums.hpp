// What builders that join subtrees from below hand to others while they do it: each merge once it
// is made, with what was found out of its two children. So nobody has to climb the tree again.
#pragma once

#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// For those who want to know nothing of the tree but its merges. CompactSums of
/// bvh/compressed/compact_sums.hpp is the other one.
struct NoMergeSums {
  struct Sum {};
  UMBEL_HOST_DEVICE Sum of(Subtree, const Aabb& /*box*/) const { return {}; }
  UMBEL_HOST_DEVICE Sum join(uint32_t /*id*/, const Merge&, Sum, Sum) const { return {}; }
};

}  // namespace umbel::bvh
