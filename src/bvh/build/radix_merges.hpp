// The radix tree over sorted Morton codes for any executor (Apetrei, "Fast and Simple Agglomerative
// LBVH Construction", 2014): a thread climbs from every leaf, and of the two that meet at a node
// the second one makes it, with its box, and climbs on. What it made itself it keeps in registers,
// and what the first one knew comes with the one atomic operation in which they meet.
#pragma once

#include <cstdint>

#include "base/exec.hpp"
#include "bvh/build/radix_splits.hpp"
#include "bvh/tree/merge_sums.hpp"

namespace umbel::bvh {

/// Writes the n - 1 merges of n > 0 codes, merge i where the codes i and i + 1 part, and the root.
template <typename Exec, typename Sums = NoMergeSums>
void radix_merges(Exec& exec, const uint64_t* codes, const uint32_t* primitives, const Aabb* boxes,
                  uint32_t n, Merge* merges, Subtree* root, const Sums& sums = {}) {
  auto met =
      exec.template allocate<uint64_t>(n);  // the far end of the codes below, and the subtree
  exec.for_each(n, [met = met.data()] UMBEL_DEVICE_LAMBDA(size_t i) { met[i] = kNobodyMet; });
  exec.for_each(n, [=, met = met.data()] UMBEL_DEVICE_LAMBDA(size_t leaf) {
    RadixClimb climb = RadixClimb::from(codes, n, static_cast<uint32_t>(leaf));
    Subtree own = Subtree::of_primitive(primitives[leaf]);
    Aabb box = boxes[own.index()];
    typename Sums::Sum sum = sums.of(own, box);
    while (!climb.is_all()) {
      const bool is_right = climb.is_right();
      const uint32_t parent = climb.parent();
      uint64_t left_there = 0;
      if (!is_second_to_meet(&met[parent], uint64_t{climb.far_end()} << 32 | own.link, left_there))
        return;
      climb.go_up(static_cast<uint32_t>(left_there >> 32));
      const Subtree other{static_cast<uint32_t>(left_there)};
      const Aabb other_box =
          other.is_primitive() ? boxes[other.index()] : merges[other.index()].box;
      const typename Sums::Sum other_sum = sums.of(other, other_box);
      const Merge merge{is_right ? united(other_box, box) : united(box, other_box),
                        is_right ? other : own, is_right ? own : other, climb.count()};
      merges[parent] = merge;
      sum = is_right ? sums.join(parent, merge, other_sum, sum)
                     : sums.join(parent, merge, sum, other_sum);
      own = Subtree::of_merge(parent);
      box = merge.box;
    }
    *root = own;
  });
}

}  // namespace umbel::bvh
