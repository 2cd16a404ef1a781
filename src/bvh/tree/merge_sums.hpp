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

  /// What a team keeps in its own memory of the merges from `first` on, while all below them are
  /// there too.
  template <uint32_t kMerges>
  struct Shared {};
  template <uint32_t kMerges>
  UMBEL_HOST_DEVICE NoMergeSums within(Shared<kMerges>&, uint32_t /*first*/) const {
    return {};
  }
  /// Copies that of the first `count` merges for which take(i) holds.
  template <typename Team, typename Take>
  UMBEL_HOST_DEVICE void copy_to(const Team&, uint32_t /*count*/, const Take&,
                                 const NoMergeSums&) const {}
};

}  // namespace umbel::bvh
