// Joins a few subtrees into a binary tree, by a team of any executor: by agglomeration, always
// the two with the smallest common box (Walter et al., "Fast Agglomerative Clustering for
// Rendering", 2008), with the nearest neighbour of each remembered, which is exact, because a merge
// never brings a third subtree nearer; or by a full sweep from the top (MacDonald & Booth, 1990).
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "base/axis.hpp"
#include "bvh/tree/leaf_rule.hpp"
#include "bvh/tree/merge_tree.hpp"
#include "bvh/tree/nearest_area.hpp"

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

/// Items of a treelet, at most, whose team shares little memory.
constexpr uint32_t kMostJoined = 128;

/// By agglomeration: a join is above the two that it joins. For at most kMost items, as below.
template <uint32_t kMost>
class TreeletAgglomerationOf {
 public:
  /// By a team, all of whose lanes see the joins after its next sync.
  template <typename Team>
  UMBEL_HOST_DEVICE void run(const Team& team, const JoinItem* items, uint32_t count, Join* joins) {
    // Whole groups of four are read.
    for (uint32_t i = team.rank(); i < count + 4; i += team.size()) {
      boxes().put(i, i < count ? items[i].box : Aabb{{0, 0, 0}, {0, 0, 0}});
      if (i >= count) continue;
      nodes_[i] = i;
      counts_[i] = items[i].count;
    }
    team.sync();
    uint32_t size = count;
    if (size > 2)
      for (uint32_t i = team.rank(); i < size; i += team.size()) find_nearest(i, size);
    team.sync();
    for (uint32_t made = 0; size > 1; ++made) {
      uint32_t a = size > 2 ? closest(team, size) : 0, b = size > 2 ? nearest_[a] : 1;
      if (a < b) std::swap(a, b);
      --size;
      team.sync();
      if (team.rank() == 0) {
        joins[made] = {nodes_[a], nodes_[b]};
        boxes().put(a, united(boxes().get(a), boxes().get(b)));
        nodes_[a] = count + made;
        counts_[a] += counts_[b];
        replace(b, size);
      }
      team.sync();
      if (size > 2) update(team, a == size ? b : a, b, size);
      team.sync();
    }
  }
  UMBEL_HOST_DEVICE void run(const JoinItem* items, uint32_t count, Join* joins) {
    run(SerialTeam{}, items, count, joins);
  }

 private:
  UMBEL_HOST_DEVICE BoxColumns boxes() {
    return {{columns_[0], columns_[1], columns_[2], columns_[3], columns_[4], columns_[5]}};
  }

  /// One of the nearest pair. Of pairs as near, the one with fewer primitives: or else what is
  /// identical would become a list.
  template <typename Team>
  UMBEL_HOST_DEVICE uint32_t closest(const Team& team, uint32_t size) const {
    uint32_t best = team.rank();
    for (uint32_t i = best + team.size(); i < size; i += team.size())
      if (is_closer(i, best)) best = i;
    if constexpr (!Team::kIsSerial) {
      best = team.reduce(best, [&](uint32_t a, uint32_t b) {
        if (a >= size || b >= size) return a < b ? a : b;
        return is_closer(b, a) || (b < a && !is_closer(a, b)) ? b : a;
      });
    }
    return best;
  }
  UMBEL_HOST_DEVICE bool is_closer(uint32_t i, uint32_t than) const {
    if (distances_[i] > distances_[than]) return false;
    return distances_[i] < distances_[than] || below(i) < below(than);
  }
  UMBEL_HOST_DEVICE uint32_t below(uint32_t i) const { return counts_[i] + counts_[nearest_[i]]; }

  /// Moves the last item into slot `b`; `update` corrects the links to both.
  UMBEL_HOST_DEVICE void replace(uint32_t b, uint32_t last) {
    boxes().copy(b, last);
    nodes_[b] = nodes_[last];
    counts_[b] = counts_[last];
    nearest_[b] = nearest_[last];
    distances_[b] = distances_[last];
  }

  /// After two were merged into `a` and the last item was moved into slot `b`: searches again for
  /// those whose nearest was one of the two, which were at `b`, and at `a` or at the end.
  template <typename Team>
  UMBEL_HOST_DEVICE void update(const Team& team, uint32_t a, uint32_t b, uint32_t size) {
    const uint32_t last = size;
    for (uint32_t i = team.rank(); i < size; i += team.size()) {
      if (i == a || nearest_[i] == a || nearest_[i] == b || (a == b && nearest_[i] == last))
        find_nearest(i, size);
      else if (nearest_[i] == last)
        nearest_[i] = b;
    }
  }

  UMBEL_HOST_DEVICE void find_nearest(uint32_t i, uint32_t size) {
    const NearestBox nearest = nearest_box(boxes(), i, 0, size);
    nearest_[i] = nearest.index;
    distances_[i] = nearest.area;
  }

  alignas(16) float columns_[6][kMost + 4];
  float distances_[kMost];
  uint32_t nearest_[kMost];
  uint32_t nodes_[kMost];
  uint32_t counts_[kMost];
};

/// By a full sweep: a range of the items is split where areas times weights are smallest. Ranges
/// are split a level at a time, each axis of each of them by a lane of its own.
template <uint32_t kMost>
class TreeletSweepOf {
 public:
  /// By a team, all of whose lanes see the joins after its next sync.
  template <typename Team>
  UMBEL_HOST_DEVICE void run(const Team& team, const JoinItem* items, uint32_t count, Join* joins) {
    // n primitives below take somewhere between one visit and n.
    for (uint32_t i = team.rank(); i < count; i += team.size())
      weights_[i] = std::sqrt(static_cast<float>(items[i].count));
    for (uint32_t axis = 0; axis < 3; ++axis) sort(team, items, axis, count);
    if (team.rank() == 0) ranges_[0] = {0, count};
    team.sync();
    // Ranges in the order in which they are found, those that they are split into later: joins in
    // reverse.
    for (uint32_t begin = 0, end = 1; begin < end;) {
      const uint32_t tasks = (end - begin) * 3;
      for (uint32_t t = team.rank(); t < tasks; t += team.size())
        choices_[t] = cheapest(items, ranges_[begin + t / 3], t % 3);
      team.sync();
      for (uint32_t r = team.rank(); r < end - begin; r += team.size())
        choose(ranges_[begin + r], &choices_[3 * r]);
      team.sync();
      for (uint32_t t = team.rank(); t < tasks; t += team.size())
        partition(ranges_[begin + t / 3], choices_[t / 3 * 3], t % 3);
      team.sync();
      if (team.rank() == 0) found_ = link(begin, end, count, joins);
      team.sync();
      begin = end;
      end = found_;
    }
  }

 private:
  using Item = std::conditional_t<kMost <= 256, uint8_t, uint16_t>;

  struct Choice {
    float cost;
    Item position;
    uint8_t axis;
  };

  UMBEL_HOST_DEVICE static float center_of(const JoinItem& item, uint32_t axis) {
    return component(item.box.min, axis) + component(item.box.max, axis);
  }

  // All lanes see the order after their next sync.
  template <typename Team>
  UMBEL_HOST_DEVICE void sort(const Team& team, const JoinItem* items, uint32_t axis,
                              uint32_t count) {
    Item* order = orders_[axis];
    float* centers = right_[axis];
    if constexpr (Team::kIsSerial) {
      for (uint32_t i = 0; i < count; ++i) {
        const float center = center_of(items[i], axis);
        uint32_t at = i;
        for (; at > 0 && centers[at - 1] > center; --at) {
          centers[at] = centers[at - 1];
          order[at] = order[at - 1];
        }
        centers[at] = center;
        order[at] = static_cast<Item>(i);
      }
    } else {
      for (uint32_t i = team.rank(); i < count; i += team.size())
        centers[i] = center_of(items[i], axis);
      team.sync();
      for (uint32_t i = team.rank(); i < count; i += team.size()) {
        uint32_t before = 0;
        for (uint32_t j = 0; j < count; ++j)
          before += centers[j] < centers[i] || (centers[j] == centers[i] && j < i) ? 1 : 0;
        order[before] = static_cast<Item>(i);
      }
    }
  }

  UMBEL_HOST_DEVICE Choice cheapest(const JoinItem* items, const Range& range, uint32_t axis) {
    Choice best{std::numeric_limits<float>::infinity(), static_cast<Item>(range.count / 2),
                static_cast<uint8_t>(axis)};
    if (range.count == 2) return best;
    const Item* order = orders_[axis] + range.offset;
    float* right = right_[axis] + range.offset;
    Aabb box;
    float weight = 0;
    for (uint32_t i = range.count; i-- > 1;) {
      extend(box, items[order[i]].box);
      weight += weights_[order[i]];
      right[i] = area_of(box) * weight;
    }
    box = {};
    weight = 0;
    for (uint32_t i = 1; i < range.count; ++i) {
      extend(box, items[order[i - 1]].box);
      weight += weights_[order[i - 1]];
      const float cost = area_of(box) * weight + right[i];
      if (cost >= best.cost) continue;
      best.cost = cost;
      best.position = static_cast<Item>(i);
    }
    return best;
  }

  /// The cheapest of three axes comes first, and its left items are marked.
  UMBEL_HOST_DEVICE void choose(const Range& range, Choice* choices) {
    for (uint32_t axis = 1; axis < 3; ++axis)
      if (choices[axis].cost < choices[0].cost) choices[0] = choices[axis];
    const Item* order = orders_[choices[0].axis] + range.offset;
    for (uint32_t i = 0; i < range.count; ++i) goes_left_[order[i]] = i < choices[0].position;
  }

  UMBEL_HOST_DEVICE void partition(const Range& range, const Choice& choice, uint32_t axis) {
    if (axis == choice.axis) return;
    Item *order = orders_[axis] + range.offset, *kept = kept_[axis] + range.offset;
    uint32_t left = 0, right = 0;
    for (uint32_t i = 0; i < range.count; ++i)
      (goes_left_[order[i]] ? order[left++] : kept[right++]) = order[i];
    for (uint32_t i = 0; i < right; ++i) order[left + i] = kept[i];
  }

  /// Makes the joins of the ranges that were split, and lists what they were split into. Returns
  /// how many ranges there are then.
  UMBEL_HOST_DEVICE uint32_t link(uint32_t begin, uint32_t end, uint32_t count, Join* joins) {
    uint32_t found = end;
    const auto node_of = [&](Range part) {
      if (part.count == 1) return static_cast<uint32_t>(orders_[0][part.offset]);
      ranges_[found] = part;
      return count + (count - 2 - found++);
    };
    for (uint32_t r = begin; r < end; ++r) {
      const Range range = ranges_[r];
      const uint32_t left = choices_[3 * (r - begin)].position;
      Join& join = joins[count - 2 - r];
      join.left = node_of({range.offset, left});
      join.right = node_of({range.offset + left, range.count - left});
    }
    return found;
  }

  float weights_[kMost], right_[3][kMost];
  Range ranges_[kMost];
  Choice choices_[3 * kMost / 2];  ///< ranges of a level have two items at least
  uint32_t found_;
  Item orders_[3][kMost], kept_[3][kMost];
  bool goes_left_[kMost];
};

/// A treelet: its items, the best way found to join them, and what is left to the one above. It
/// lies in memory that a team shares, so nothing has a value at first.
template <uint32_t kMost>
class TreeletJoinOf {
 public:
  /// By one lane; at most kMost items.
  UMBEL_HOST_DEVICE void begin(uint32_t items) {
    size_ = items;
    cost_ = 0;
  }
  UMBEL_HOST_DEVICE void put(uint32_t i, const JoinItem& item) { nodes_[i] = item; }

  /// By a team, once all lanes see the items. The first lane sees what becomes of them.
  template <typename Team>
  UMBEL_HOST_DEVICE void agglomerate(const Team& team, const LeafRule& rule,
                                     TreeletAgglomerationOf<kMost>& agglomeration) {
    if (size_ < 2) return;
    agglomeration.run(team, nodes_, size_, joins_);
    if (team.rank() == 0) cost_ = evaluate(rule, joins_);
  }

  /// By a team. Keeps what is there if it is cheaper.
  template <typename Team>
  UMBEL_HOST_DEVICE void sweep(const Team& team, const LeafRule& rule,
                               TreeletSweepOf<kMost>& sweep) {
    if (size_ < 3) return;
    sweep.run(team, nodes_, size_, by_sweep_);
    if (team.rank() != 0) return;
    if (evaluate(rule, by_sweep_) < cost_)
      for (uint32_t i = 0; i + 1 < size_; ++i) joins_[i] = by_sweep_[i];
    evaluate(rule, joins_);
  }

  /// By one lane. Opens the joins with the largest boxes until `left` nodes are left, makes the
  /// other joins, and writes the nodes that are left for the treelet above. Each merge takes the
  /// slot of one of its two. Returns how many nodes are left.
  UMBEL_HOST_DEVICE uint32_t forward(uint32_t left, Merge* merges, JoinItem* out) {
    if (size_ == 0) return 0;
    const uint32_t root = 2 * size_ - 2;
    for (uint32_t i = 0; i + 1 < size_; ++i) is_open_[i] = false;
    open_[0] = root;
    uint32_t count = 1;
    while (count < left) {
      uint32_t largest = count;
      for (uint32_t i = 0; i < count; ++i)
        if (open_[i] >= size_ && (largest == count || area_of(nodes_[open_[i]].box) >
                                                          area_of(nodes_[open_[largest]].box)))
          largest = i;
      if (largest == count) break;
      const Join join = joins_[open_[largest] - size_];
      is_open_[open_[largest] - size_] = true;
      open_[largest] = join.left;
      open_[count++] = join.right;
    }
    for (uint32_t i = 0; i + 1 < size_; ++i)
      if (!is_open_[i]) make(i, merges);
    for (uint32_t i = 0; i < count; ++i) out[i] = nodes_[open_[i]];
    return count;
  }

 private:
  /// Boxes, counts and costs of all joins; returns the cost of the last one.
  UMBEL_HOST_DEVICE float evaluate(const LeafRule& rule, const Join* joins) {
    for (uint32_t i = 0; i + 1 < size_; ++i) {
      const JoinItem &a = nodes_[joins[i].left], &b = nodes_[joins[i].right];
      JoinItem& node = nodes_[size_ + i];
      node.box = united(a.box, b.box);
      node.count = a.count + b.count;
      node.cost = rule.cheaper(node.box, node.count, a.cost, b.cost);
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

  uint32_t size_;  ///< items
  float cost_;
  Join joins_[kMost], by_sweep_[kMost];
  uint32_t open_[kMost];
  bool is_open_[kMost];
  JoinItem nodes_[2 * kMost];  ///< items, and then joins
};

using TreeletAgglomeration = TreeletAgglomerationOf<kMostJoined>;
using TreeletSweep = TreeletSweepOf<kMostJoined>;
using TreeletJoin = TreeletJoinOf<kMostJoined>;

}  // namespace umbel::bvh
