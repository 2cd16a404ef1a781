// The radix tree over sorted Morton codes for any executor (Apetrei, "Fast and Simple Agglomerative
// LBVH Construction", 2014): a thread climbs from every leaf, and of the two that meet at a node
// the second one makes it, with its box, and climbs on.
#pragma once

#include <cstdint>

#include "base/exec.hpp"
#include "bvh/build/radix_splits.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// Writes the n - 1 merges of n > 0 codes, merge i where the codes i and i + 1 part, and the root.
template <typename Exec>
void radix_merges(Exec& exec, const uint64_t* codes, const uint32_t* primitives, const Aabb* boxes,
                  uint32_t n, Merge* merges, Subtree* root) {
  auto arrived = exec.template allocate<uint32_t>(n);
  auto begins = exec.template allocate<uint32_t>(n);  // of the codes below a merge
  auto ends = exec.template allocate<uint32_t>(n);    // the last one
  exec.for_each(n, [arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t i) { arrived[i] = 0; });
  exec.for_each(n, [=, arrived = arrived.data(), begins = begins.data(),
                    ends = ends.data()] UMBEL_DEVICE_LAMBDA(size_t leaf) {
    auto begin = static_cast<uint32_t>(leaf), end = begin;
    Subtree subtree = Subtree::of_primitive(primitives[leaf]);
    while (end - begin < n - 1) {
      const bool is_right = end == n - 1 || (begin > 0 && common_bits(codes, begin - 1, begin) >
                                                              common_bits(codes, end, end + 1));
      const uint32_t parent = is_right ? begin - 1 : end;
      Merge& merge = merges[parent];
      (is_right ? merge.right : merge.left) = subtree;
      (is_right ? ends[parent] : begins[parent]) = is_right ? end : begin;
      if (!is_last_to_arrive(&arrived[parent], 1)) return;
      begin = begins[parent];
      end = ends[parent];
      const auto box_of = [&](Subtree s) {
        return s.is_primitive() ? boxes[s.index()] : merges[s.index()].box;
      };
      merge.box = united(box_of(merge.left), box_of(merge.right));
      merge.count = end - begin + 1;
      subtree = Subtree::of_merge(parent);
    }
    *root = subtree;
  });
}

}  // namespace umbel::bvh
