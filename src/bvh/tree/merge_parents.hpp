// The way up a tree of merges, for any executor.
#pragma once

#include "base/exec.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// The merges above each merge and above each item; kNone above the root.
struct MergeParents {
  uint32_t* of_merges;
  uint32_t* of_items;

  /// Writes the parent of the children of merge i; for i = merge_count that of the root. Skips
  /// merges without primitives (count 0).
  UMBEL_HOST_DEVICE void set_below(const Merge* merges, uint32_t merge_count, Subtree root,
                                   size_t i) const {
    if (i == merge_count) {
      (root.is_primitive() ? of_items : of_merges)[root.index()] = kNone;
      return;
    }
    const Merge& merge = merges[i];
    if (merge.count == 0) return;
    for (const Subtree s : {merge.left, merge.right})
      (s.is_primitive() ? of_items : of_merges)[s.index()] = static_cast<uint32_t>(i);
  }
};

template <typename Exec>
void find_parents(Exec& exec, const Merge* merges, uint32_t merge_count, const Subtree* root,
                  const MergeParents& parents) {
  exec.for_each(merge_count + size_t{1}, [=] UMBEL_DEVICE_LAMBDA(size_t i) {
    parents.set_below(merges, merge_count, *root, i);
  });
}

}  // namespace umbel::bvh
