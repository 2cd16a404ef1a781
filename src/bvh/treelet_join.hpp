// Joins a few subtrees into a binary tree, on one thread of any executor: by agglomeration, always
// the two with the smallest common box (Walter et al., "Fast Agglomerative Clustering for
// Rendering", 2008), with the nearest neighbour of each remembered, which is exact, because a merge
// never brings a third subtree nearer; or by a full sweep from the top (MacDonald & Booth, 1990).
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>

#include "bvh/leaf_rule.hpp"
#include "bvh/merge_tree.hpp"
#include "bvh/nearest_area.hpp"

namespace umbel::bvh {

/// A subtree with what is needed to join it.
struct JoinItem {
  Aabb box;
  Subtree subtree;
  uint32_t count;  ///< primitives
  float cost;
  uint32_t slot;  ///< of a merge that is not made yet
};

/// Two nodes joined: items are 0, 1, ..., and the i-th of n - 1 joins is n + i.
struct Join {
  uint32_t left, right;
};

constexpr uint32_t kMostJoined = 128;

/// By agglomeration: a join is above the two that it joins.
class TreeletAgglomeration {
 public:
  UMBEL_HOST_DEVICE void run(const JoinItem* items, uint32_t count, Join* joins) {
    size_ = count;
    for (uint32_t i = 0; i < count; ++i) {
      boxes().put(i, items[i].box);
      nodes_[i] = i;
      counts_[i] = items[i].count;
    }
    if (size_ > 2)
      for (uint32_t i = 0; i < size_; ++i) find_nearest(i);
    for (uint32_t made = 0; size_ > 1; ++made) {
      uint32_t a = size_ > 2 ? closest() : 0, b = size_ > 2 ? nearest_[a] : 1;
      if (a < b) std::swap(a, b);
      joins[made] = {nodes_[a], nodes_[b]};
      boxes().put(a, united(boxes().get(a), boxes().get(b)));
      nodes_[a] = count + made;
      counts_[a] += counts_[b];
      remove(b);
      if (size_ > 2) update(a == size_ ? b : a, b);
    }
  }

 private:
  UMBEL_HOST_DEVICE BoxColumns boxes() {
    return {{columns_[0], columns_[1], columns_[2], columns_[3], columns_[4], columns_[5]}};
  }

  /// One of the nearest pair. Of pairs as near, the one with fewer primitives: or else what is
  /// identical would become a list.
  UMBEL_HOST_DEVICE uint32_t closest() const {
    uint32_t best = 0;
    for (uint32_t i = 1; i < size_; ++i) {
      if (distances_[i] > distances_[best]) continue;
      if (distances_[i] < distances_[best] || below(i) < below(best)) best = i;
    }
    return best;
  }
  UMBEL_HOST_DEVICE uint32_t below(uint32_t i) const { return counts_[i] + counts_[nearest_[i]]; }

  /// The last item takes the place of item `b`; links to both are put right by `update`.
  UMBEL_HOST_DEVICE void remove(uint32_t b) {
    const uint32_t last = --size_;
    boxes().copy(b, last);
    nodes_[b] = nodes_[last];
    counts_[b] = counts_[last];
    nearest_[b] = nearest_[last];
    distances_[b] = distances_[last];
  }

  /// After two were merged into `a` and the last item took the place `b`: searches anew for those
  /// that had one of the two nearest. They were at `b`, and at `a` or at the end.
  UMBEL_HOST_DEVICE void update(uint32_t a, uint32_t b) {
    const uint32_t last = size_;
    for (uint32_t i = 0; i < size_; ++i) {
      if (i == a || nearest_[i] == a || nearest_[i] == b || (a == b && nearest_[i] == last))
        find_nearest(i);
      else if (nearest_[i] == last)
        nearest_[i] = b;
    }
  }

  UMBEL_HOST_DEVICE void find_nearest(uint32_t i) {
    const NearestBox nearest = nearest_box(boxes(), i, 0, size_);
    nearest_[i] = nearest.index;
    distances_[i] = nearest.area;
  }

  // Zeros, because whole groups of four are read.
  alignas(16) float columns_[6][kMostJoined + 4] = {};
  float distances_[kMostJoined];
  uint32_t nearest_[kMostJoined];
  uint32_t nodes_[kMostJoined];
  uint32_t counts_[kMostJoined];
  uint32_t size_ = 0;
};

/// By a full sweep: a range of the items is split where areas times weights are smallest.
class TreeletSweep {
 public:
  UMBEL_HOST_DEVICE void run(const JoinItem* items, uint32_t count, Join* joins) {
    items_ = items;
    for (uint32_t i = 0; i < count; ++i)
      // n primitives below take somewhere between one visit and n.
      weights_[i] = std::sqrt(static_cast<float>(items[i].count));
    for (int axis = 0; axis < 3; ++axis) sort(axis, count);
    // Ranges in the order in which they are found, those that they are split into later: joins in
    // reverse.
    Range ranges[kMostJoined];
    ranges[0] = {0, count};
    uint32_t found = 1;
    for (uint32_t r = 0; r < found; ++r) {
      const Range range = ranges[r];
      const uint32_t left = split(range);
      const auto node_of = [&](Range part) {
        if (part.count == 1) return static_cast<uint32_t>(orders_[0][part.offset]);
        ranges[found] = part;
        return count + (count - 2 - found++);
      };
      Join& join = joins[count - 2 - r];
      join.left = node_of({range.offset, left});
      join.right = node_of({range.offset + left, range.count - left});
    }
  }

 private:
  UMBEL_HOST_DEVICE static float component(const Vec3& v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
  }

  UMBEL_HOST_DEVICE void sort(int axis, uint32_t count) {
    float centers[kMostJoined];
    uint8_t* order = orders_[axis];
    for (uint32_t i = 0; i < count; ++i) {
      const Aabb& box = items_[i].box;
      const float center = component(box.min, axis) + component(box.max, axis);
      uint32_t at = i;
      for (; at > 0 && centers[at - 1] > center; --at) {
        centers[at] = centers[at - 1];
        order[at] = order[at - 1];
      }
      centers[at] = center;
      order[at] = static_cast<uint8_t>(i);
    }
  }

  /// Orders the range so that what goes left comes first, and returns how many.
  UMBEL_HOST_DEVICE uint32_t split(Range range) {
    if (range.count == 2) return 1;
    float least = std::numeric_limits<float>::infinity();
    uint32_t position = range.count / 2;
    int chosen = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const uint8_t* order = orders_[axis] + range.offset;
      float right[kMostJoined];
      Aabb box;
      float weight = 0;
      for (uint32_t i = range.count; i-- > 1;) {
        extend(box, items_[order[i]].box);
        weight += weights_[order[i]];
        right[i] = area_of(box) * weight;
      }
      box = {};
      weight = 0;
      for (uint32_t i = 1; i < range.count; ++i) {
        extend(box, items_[order[i - 1]].box);
        weight += weights_[order[i - 1]];
        const float cost = area_of(box) * weight + right[i];
        if (cost >= least) continue;
        least = cost;
        position = i;
        chosen = axis;
      }
    }
    partition(range, chosen, position);
    return position;
  }

  UMBEL_HOST_DEVICE void partition(Range range, int chosen, uint32_t position) {
    bool goes_left[kMostJoined];
    for (uint32_t i = 0; i < range.count; ++i)
      goes_left[orders_[chosen][range.offset + i]] = i < position;
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == chosen) continue;
      uint8_t* order = orders_[axis] + range.offset;
      uint8_t kept[kMostJoined];
      uint32_t left = 0, right = 0;
      for (uint32_t i = 0; i < range.count; ++i)
        (goes_left[order[i]] ? order[left++] : kept[right++]) = order[i];
      for (uint32_t i = 0; i < right; ++i) order[left + i] = kept[i];
    }
  }

  const JoinItem* items_ = nullptr;
  float weights_[kMostJoined];
  uint8_t orders_[3][kMostJoined];
};

/// A treelet: its items, the best way found to join them, and what is left to the one above.
class TreeletJoin {
 public:
  UMBEL_HOST_DEVICE explicit TreeletJoin(const LeafRule& rule) : rule_(rule) {}

  /// At most kMostJoined in all.
  UMBEL_HOST_DEVICE void add(const JoinItem& item) { nodes_[size_++] = item; }

  UMBEL_HOST_DEVICE void agglomerate() {
    if (size_ < 2) return;
    TreeletAgglomeration().run(nodes_, size_, joins_);
    cost_ = evaluate(joins_);
  }

  /// Keeps what is there if it is cheaper.
  UMBEL_HOST_DEVICE void sweep() {
    if (size_ < 3) return;
    Join joins[kMostJoined];
    TreeletSweep().run(nodes_, size_, joins);
    if (evaluate(joins) < cost_)
      for (uint32_t i = 0; i + 1 < size_; ++i) joins_[i] = joins[i];
    evaluate(joins_);
  }

  /// Opens the joins with the largest boxes until `left` nodes are left, makes the others, and
  /// writes what is left. Each merge takes the slot of one of its two. Returns how many are left.
  UMBEL_HOST_DEVICE uint32_t hand_up(uint32_t left, Merge* merges, JoinItem* out) {
    if (size_ == 0) return 0;
    const uint32_t root = 2 * size_ - 2;
    uint32_t open[kMostJoined];
    bool is_open[kMostJoined] = {};
    open[0] = root;
    uint32_t count = 1;
    while (count < left) {
      uint32_t largest = count;
      for (uint32_t i = 0; i < count; ++i)
        if (open[i] >= size_ &&
            (largest == count || area_of(nodes_[open[i]].box) > area_of(nodes_[open[largest]].box)))
          largest = i;
      if (largest == count) break;
      const Join join = joins_[open[largest] - size_];
      is_open[open[largest] - size_] = true;
      open[largest] = join.left;
      open[count++] = join.right;
    }
    for (uint32_t i = 0; i + 1 < size_; ++i)
      if (!is_open[i]) make(i, merges);
    for (uint32_t i = 0; i < count; ++i) out[i] = nodes_[open[i]];
    return count;
  }

 private:
  /// Boxes, counts and costs of all joins; returns the cost of the last one.
  UMBEL_HOST_DEVICE float evaluate(const Join* joins) {
    for (uint32_t i = 0; i + 1 < size_; ++i) {
      const JoinItem &a = nodes_[joins[i].left], &b = nodes_[joins[i].right];
      JoinItem& node = nodes_[size_ + i];
      node.box = united(a.box, b.box);
      node.count = a.count + b.count;
      node.cost = rule_.cheaper(node.box, node.count, a.cost, b.cost);
    }
    return nodes_[2 * size_ - 2].cost;
  }

  UMBEL_HOST_DEVICE void make(uint32_t i, Merge* merges) {
    const JoinItem &a = nodes_[joins_[i].left], &b = nodes_[joins_[i].right];
    JoinItem& node = nodes_[size_ + i];
    merges[b.slot] = {node.box, a.subtree, b.subtree, node.count};
    node.subtree = Subtree::of_merge(b.slot);
    node.slot = a.slot;
  }

  const LeafRule& rule_;
  uint32_t size_ = 0;  ///< items
  float cost_ = 0;
  Join joins_[kMostJoined];
  JoinItem nodes_[2 * kMostJoined];  ///< items, and then joins
};

}  // namespace umbel::bvh
