// Hierarchical linear BVH for any executor (Garanzha, Pantaleoni & McAllister, "Simpler and Faster
// HLBVH with Work Queues", 2011): the radix tree over all Morton codes holds the treelets, which
// are its subtrees of the codes that agree in their leading bits; a full sweep replaces the merges
// above them.
#pragma once

#include "bvh/build/radix_merges.hpp"
#include "bvh/build/sweep_merges.hpp"

namespace umbel::bvh {

/// Codes of kHlbvhBits an axis, sorted; writes the n - 1 merges of n > 0 primitives, and the root.
inline constexpr uint32_t kHlbvhBits = 20;

template <typename Exec>
void hlbvh_merges(Exec& exec, const uint64_t* codes, const uint32_t* primitives, const Aabb* boxes,
                  uint32_t n, uint32_t leading_bits, Merge* merges, Subtree* root) {
  radix_merges(exec, codes, primitives, boxes, n, merges, root);
  const uint64_t prefixes = uint64_t{1} << leading_bits;
  const auto most = static_cast<uint32_t>(n < prefixes ? n : prefixes);
  auto starts = exec.template allocate<uint32_t>(n + size_t{1});
  auto count = exec.template allocate<uint32_t>(1);
  {
    auto leading = exec.template allocate<uint32_t>(n);
    exec.for_each(
        n, [=, leading = leading.data(), shift = 3 * kHlbvhBits - leading_bits] UMBEL_DEVICE_LAMBDA(
               size_t i) { leading[i] = static_cast<uint32_t>(codes[i] >> shift); });
    exec.run_length(n, leading.data(), starts.data(), count.data());
  }
  auto treelet_boxes = exec.template allocate<Aabb>(most);
  auto treelet_counts = exec.template allocate<uint32_t>(most);
  auto subtrees = exec.template allocate<Subtree>(most);
  auto ids = exec.template allocate<uint32_t>(most);
  exec.for_each_of(count.data(), most, 1,
                   [=, starts = starts.data(), treelet_boxes = treelet_boxes.data(),
                    treelet_counts = treelet_counts.data(), subtrees = subtrees.data(),
                    ids = ids.data()] UMBEL_DEVICE_LAMBDA(size_t t) {
                     const uint32_t begin = starts[t], end = starts[t + 1];
                     const Subtree subtree =
                         end - begin == 1 ? Subtree::of_primitive(primitives[begin])
                                          : Subtree::of_merge(radix_split(codes, begin, end) - 1);
                     treelet_boxes[t] = subtree.is_primitive() ? boxes[subtree.index()]
                                                               : merges[subtree.index()].box;
                     treelet_counts[t] = end - begin;
                     subtrees[t] = subtree;
                     // The merges to be replaced are those where leading bits differ.
                     ids[t] = begin - 1;
                   });
  sweep_merges(exec, {treelet_boxes.data(), treelet_counts.data(), subtrees.data(), ids.data()},
               count.data(), most, merges, root);
}

}  // namespace umbel::bvh
