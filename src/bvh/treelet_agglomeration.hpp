// Turns the children of one node with many into a binary tree: merges the two whose common box is
// smallest until one is left (Walter et al., "Fast Agglomerative Clustering for Rendering", 2008),
// with the nearest neighbour of each remembered. That is exact, because a merge never brings a
// third subtree nearer.
#pragma once

#include <cstdint>
#include <utility>

#include "bvh/merge_tree.hpp"
#include "bvh/nearest_area.hpp"

namespace umbel::bvh {

/// A subtree with what is needed to merge it.
struct MergeItem {
  Aabb box;
  Subtree subtree;
  uint32_t count;
  uint32_t slot;  ///< of a merge that is not made yet
};

class TreeletAgglomeration {
 public:
  static constexpr uint32_t kMost = 64;

  /// Forgets all items.
  void clear() { size_ = 0; }

  /// At most kMost in all.
  void add(const MergeItem& item) {
    boxes().put(size_, item.box);
    subtrees_[size_] = item.subtree;
    slots_[size_] = item.slot;
    counts_[size_++] = item.count;
  }

  uint32_t size() const { return size_; }
  MergeItem item(uint32_t i) { return {boxes().get(i), subtrees_[i], counts_[i], slots_[i]}; }

  /// Merges until `left` items are left. Each merge takes the slot of one of its two.
  void run(Merge* merges, uint32_t left) {
    if (size_ > left && size_ > 2)
      for (uint32_t i = 0; i < size_; ++i) find_nearest(i);
    while (size_ > left) {
      uint32_t a = size_ > 2 ? closest() : 0, b = size_ > 2 ? nearest_[a] : 1;
      if (a < b) std::swap(a, b);
      const uint32_t merge = slots_[b];
      merges[merge] = {united(boxes().get(a), boxes().get(b)), subtrees_[a], subtrees_[b],
                       counts_[a] + counts_[b]};
      boxes().put(a, merges[merge].box);
      subtrees_[a] = Subtree::of_merge(merge);
      counts_[a] = merges[merge].count;
      remove(b);
      if (size_ > 2) update(a == size_ ? b : a, b);
    }
  }

 private:
  BoxColumns boxes() {
    return {{columns_[0], columns_[1], columns_[2], columns_[3], columns_[4], columns_[5]}};
  }

  /// One of the nearest pair. Of pairs as near, the one with fewer primitives: or else what is
  /// identical would become a list.
  uint32_t closest() const {
    uint32_t best = 0;
    for (uint32_t i = 1; i < size_; ++i) {
      if (distances_[i] > distances_[best]) continue;
      if (distances_[i] < distances_[best] || below(i) < below(best)) best = i;
    }
    return best;
  }
  uint32_t below(uint32_t i) const { return counts_[i] + counts_[nearest_[i]]; }

  /// The last item takes the place of item `b`; links to both are put right by `update`.
  void remove(uint32_t b) {
    const uint32_t last = --size_;
    boxes().copy(b, last);
    subtrees_[b] = subtrees_[last];
    slots_[b] = slots_[last];
    counts_[b] = counts_[last];
    nearest_[b] = nearest_[last];
    distances_[b] = distances_[last];
  }

  /// After two were merged into `a` and the last item took the place `b`: searches anew for those
  /// that had one of the two nearest. They were at `b`, and at `a` or at the end.
  void update(uint32_t a, uint32_t b) {
    const uint32_t last = size_;
    for (uint32_t i = 0; i < size_; ++i) {
      if (i == a || nearest_[i] == a || nearest_[i] == b || (a == b && nearest_[i] == last))
        find_nearest(i);
      else if (nearest_[i] == last)
        nearest_[i] = b;
    }
  }

  void find_nearest(uint32_t i) {
    const NearestBox nearest = nearest_box(boxes(), i, 0, size_);
    nearest_[i] = nearest.index;
    distances_[i] = nearest.area;
  }

  // Zeros, because whole groups of four are read.
  alignas(16) float columns_[6][kMost + 4] = {};
  float distances_[kMost];
  uint32_t nearest_[kMost];
  Subtree subtrees_[kMost];
  uint32_t slots_[kMost];
  uint32_t counts_[kMost];
  uint32_t size_ = 0;
};

}  // namespace umbel::bvh
