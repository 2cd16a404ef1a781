// Turns the children of one node with many into a binary tree: merges the two whose common box is
// smallest until one is left (Walter et al., "Fast Agglomerative Clustering for Rendering", 2008),
// with the nearest neighbour of each remembered. That is exact, because a merge never brings a
// third subtree nearer.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "bvh/merge_tree.hpp"

namespace umbel::bvh {

/// A subtree with what is needed to merge it.
struct MergeItem {
  Aabb box;
  Subtree subtree;
  uint32_t count;
};

class TreeletAgglomeration {
 public:
  static constexpr uint32_t kMost = 64;

  /// Forgets all items.
  void clear() { size_ = 0; }

  /// At most kMost in all.
  void add(const MergeItem& item) {
    put(size_, item.box);
    subtrees_[size_] = item.subtree;
    counts_[size_++] = item.count;
  }

  /// Merges all items, at least one, into one. The i-th merge is stored as merges[slot(i)].
  template <typename Slot>
  MergeItem run(Merge* merges, const Slot& slot) {
    if (size_ > 2)
      for (uint32_t i = 0; i < size_; ++i) find_nearest(i);
    for (uint32_t made = 0; size_ > 1; ++made) {
      uint32_t a = size_ > 2 ? closest() : 0, b = size_ > 2 ? nearest_[a] : 1;
      if (b < a) std::swap(a, b);
      const uint32_t merge = slot(made);
      merges[merge] = {united(box(a), box(b)), subtrees_[a], subtrees_[b], counts_[a] + counts_[b]};
      put(a, merges[merge].box);
      subtrees_[a] = Subtree::of_merge(merge);
      counts_[a] = merges[merge].count;
      remove(b);
      if (size_ > 2) update(a, b);
    }
    return {box(0), subtrees_[0], counts_[0]};
  }

 private:
  Aabb box(uint32_t i) const {
    return {{lo_[0][i], lo_[1][i], lo_[2][i]}, {hi_[0][i], hi_[1][i], hi_[2][i]}};
  }

  void put(uint32_t i, const Aabb& b) {
    lo_[0][i] = b.min.x, lo_[1][i] = b.min.y, lo_[2][i] = b.min.z;
    hi_[0][i] = b.max.x, hi_[1][i] = b.max.y, hi_[2][i] = b.max.z;
  }

  uint32_t closest() const {
    uint32_t best = 0;
    for (uint32_t i = 1; i < size_; ++i)
      if (distance_[i] < distance_[best]) best = i;
    return best;
  }

  /// The last item takes the place of item `b`; links to both are put right by `update`.
  void remove(uint32_t b) {
    const uint32_t last = --size_;
    put(b, box(last));
    subtrees_[b] = subtrees_[last];
    counts_[b] = counts_[last];
    nearest_[b] = nearest_[last];
    distance_[b] = distance_[last];
  }

  /// After b was merged into a: searches anew for those that had one of them nearest.
  void update(uint32_t a, uint32_t b) {
    const uint32_t last = size_;
    for (uint32_t i = 0; i < size_; ++i) {
      if (i == a || nearest_[i] == a || nearest_[i] == b)
        find_nearest(i);
      else if (nearest_[i] == last)
        nearest_[i] = b;
    }
  }

  void find_nearest(uint32_t i) {
    alignas(16) std::array<float, kMost> areas;
    const uint32_t padded = (size_ + 3) & ~3u;
    const Aabb a = box(i);
    for (uint32_t j = 0; j < padded; ++j) {
      const float x = std::max(a.max.x, hi_[0][j]) - std::min(a.min.x, lo_[0][j]);
      const float y = std::max(a.max.y, hi_[1][j]) - std::min(a.min.y, lo_[1][j]);
      const float z = std::max(a.max.z, hi_[2][j]) - std::min(a.min.z, lo_[2][j]);
      areas[j] = x * y + z * (x + y);
    }
    areas[i] = std::numeric_limits<float>::infinity();
    float least = areas[0];
    uint32_t best = 0;
    for (uint32_t j = 1; j < size_; ++j) {
      best = areas[j] < least ? j : best;
      least = areas[j] < least ? areas[j] : least;
    }
    nearest_[i] = best;
    distance_[i] = least;
  }

  // Zeros, because whole groups of four are read.
  alignas(16) float lo_[3][kMost] = {}, hi_[3][kMost] = {};
  float distance_[kMost];
  uint32_t nearest_[kMost];
  Subtree subtrees_[kMost];
  uint32_t counts_[kMost];
  uint32_t size_ = 0;
};

}  // namespace umbel::bvh
