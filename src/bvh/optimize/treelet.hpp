// Treelet restructuring for any executor (Domingues & Pedrini, "Bounding Volume Hierarchy
// Optimization through Agglomerative Treelet Restructuring", 2015): bottom-up, the few largest
// subtrees below each node are agglomerated, always the two with the smallest common box, and the
// result is kept where it costs less (as in Karras & Aila, "Fast Parallel Construction of
// High-Quality Bounding Volume Hierarchies", 2013, who search all ways of joining them).
#pragma once

#include <cstdint>
#include <limits>

#include "base/exec.hpp"
#include "base/progress.hpp"
#include "bvh/tree/leaf_rule.hpp"
#include "bvh/tree/merge_parents.hpp"

namespace umbel::bvh {

/// A tree of merges over items.
struct TreeletInput {
  const Aabb* boxes;
  const uint32_t* primitives;  ///< of each item; none: one each
  uint32_t items;
  Merge* merges;
};

/// One treelet: takes it apart and agglomerates it, on one thread.
class Treelet {
 public:
  static constexpr uint32_t kMost = 15;

  UMBEL_HOST_DEVICE Treelet(const TreeletInput& tree, float* costs, const LeafRule& rule)
      : tree_(tree), costs_(costs), rule_(rule) {}

  UMBEL_HOST_DEVICE float cost_of(Subtree s) const {
    if (!s.is_primitive()) return costs_[s.index()];
    return rule_.leaf_cost(tree_.boxes[s.index()],
                           tree_.primitives ? tree_.primitives[s.index()] : 1);
  }
  /// Of the merge as it is.
  UMBEL_HOST_DEVICE float cost_of_merge(const Merge& m) const {
    return rule_.cheaper(m.box, m.count, cost_of(m.left), cost_of(m.right));
  }

  /// True if the treelet of at most `size` subtrees below the merge `root` has become cheaper.
  UMBEL_HOST_DEVICE bool restructure(uint32_t root, uint32_t size) {
    take_apart(root, size);
    const uint32_t leaves = used_;
    const float cost = join();
    if (!(cost < costs_[root] * kWorthwhile)) return false;
    write(leaves);
    costs_[root] = cost;
    return true;
  }

  /// The merges that were taken apart, the root first, once restructured.
  UMBEL_HOST_DEVICE uint32_t merge_count() const { return merge_count_; }
  UMBEL_HOST_DEVICE uint32_t merge(uint32_t i) const { return merge_ids_[i]; }

 private:
  static constexpr float kWorthwhile = 1 - 1e-5f;  ///< rounding alone should move nothing

  struct Part {
    Aabb box;
    float cost;
    uint32_t count;
    Subtree subtree;  ///< until it is written: ~i for what the i-th join made
  };
  struct Join {
    Part left, right;
    Aabb box;
    float cost;
    uint32_t count;
  };

  UMBEL_HOST_DEVICE uint32_t count_of(Subtree s) const {
    return s.is_primitive() ? 1 : tree_.merges[s.index()].count;
  }
  UMBEL_HOST_DEVICE Part part_of(Subtree s) const {
    const Aabb& box = s.is_primitive() ? tree_.boxes[s.index()] : tree_.merges[s.index()].box;
    return {box, cost_of(s), count_of(s), s};
  }

  /// Opens the merge with the largest box again and again.
  UMBEL_HOST_DEVICE void take_apart(uint32_t root, uint32_t size) {
    used_ = merge_count_ = 0;
    open(root);
    while (used_ < size) {
      float largest = -1;
      uint32_t chosen = used_;
      for (uint32_t i = 0; i < used_; ++i) {
        if (parts_[i].subtree.is_primitive()) continue;
        const float area = area_of(parts_[i].box);
        if (area <= largest) continue;
        largest = area;
        chosen = i;
      }
      if (chosen == used_) return;
      const uint32_t merge = parts_[chosen].subtree.index();
      parts_[chosen] = parts_[--used_];
      open(merge);
    }
  }
  UMBEL_HOST_DEVICE void open(uint32_t merge) {
    merge_ids_[merge_count_++] = merge;
    parts_[used_++] = part_of(tree_.merges[merge].left);
    parts_[used_++] = part_of(tree_.merges[merge].right);
  }

  /// Joins the parts into one, and returns its cost.
  UMBEL_HOST_DEVICE float join() {
    for (uint32_t i = 1; i < used_; ++i)
      for (uint32_t j = 0; j < i; ++j) distance_[i][j] = distance(i, j);
    join_count_ = 0;
    while (used_ > 1) {
      uint32_t a = 1, b = 0;
      for (uint32_t i = 2; i < used_; ++i)
        for (uint32_t j = 0; j < i; ++j)
          if (distance_[i][j] < distance_[a][b]) a = i, b = j;
      join_two(a, b);
    }
    return parts_[0].cost;
  }
  UMBEL_HOST_DEVICE float distance(uint32_t i, uint32_t j) const {
    return area_of(united(parts_[i].box, parts_[j].box));
  }

  /// Writes the joined part to b < a, and moves the last one to a.
  UMBEL_HOST_DEVICE void join_two(uint32_t a, uint32_t b) {
    Join& join = joins_[join_count_];
    join.left = parts_[b];
    join.right = parts_[a];
    join.box = united(join.left.box, join.right.box);
    join.count = join.left.count + join.right.count;
    join.cost = rule_.cheaper(join.box, join.count, join.left.cost, join.right.cost);
    parts_[b] = {join.box, join.cost, join.count, {~join_count_++}};
    const uint32_t last = --used_;
    if (a != last) {
      parts_[a] = parts_[last];
      for (uint32_t i = 0; i < last; ++i)
        if (i != a) (i < a ? distance_[a][i] : distance_[i][a]) = distance_[last][i];
    }
    for (uint32_t i = 0; i < used_; ++i)
      if (i != b) (i < b ? distance_[b][i] : distance_[i][b]) = distance(i, b);
  }

  /// The last join becomes the root; the others, from the last on, the merges below it.
  UMBEL_HOST_DEVICE void write(uint32_t leaves) {
    for (uint32_t i = 0; i + 1 < leaves; ++i) {
      const Join& join = joins_[i];
      const uint32_t id = id_of(i);
      tree_.merges[id] = {join.box, resolved(join.left.subtree, i), resolved(join.right.subtree, i),
                          join.count};
      costs_[id] = join.cost;
    }
  }
  UMBEL_HOST_DEVICE uint32_t id_of(uint32_t join) const {
    return merge_ids_[join_count_ - 1 - join];
  }
  /// Links ~i with i below `joins` are joins: ids of primitives and merges never come so high.
  UMBEL_HOST_DEVICE Subtree resolved(Subtree s, uint32_t joins) const {
    return ~s.link < joins ? Subtree::of_merge(id_of(~s.link)) : s;
  }

  const TreeletInput& tree_;
  float* costs_;
  const LeafRule& rule_;
  Part parts_[kMost + 1];
  Join joins_[kMost];
  float distance_[kMost + 1][kMost + 1];
  uint32_t merge_ids_[kMost];
  uint32_t used_ = 0, merge_count_ = 0, join_count_ = 0;
};

/// Restructures treelets of `size` subtrees (3..15) all over the tree, in rounds.
template <typename Exec>
class TreeletRounds {
 public:
  TreeletRounds(Exec& exec, const TreeletInput& tree, const Subtree* root, const LeafRule& rule)
      : exec_(exec), tree_(tree), rule_(rule) {
    costs_ = exec.template allocate<float>(tree.items);
    arrived_ = exec.template allocate<uint32_t>(tree.items);
    merge_parents_ = exec.template allocate<uint32_t>(tree.items);
    item_parents_ = exec.template allocate<uint32_t>(tree.items);
    find_parents(exec, tree.merges, tree.items - 1, root,
                 {merge_parents_.data(), item_parents_.data()});
  }

  void run_round(uint32_t size) {
    exec_.for_each(tree_.items,
                   [arrived = arrived_.data()] UMBEL_DEVICE_LAMBDA(size_t i) { arrived[i] = 0; });
    exec_.for_each(tree_.items, [tree = tree_, rule = rule_, size, costs = costs_.data(),
                                 arrived = arrived_.data(), of_merges = merge_parents_.data(),
                                 of_items = item_parents_.data()] UMBEL_DEVICE_LAMBDA(size_t item) {
      Treelet treelet(tree, costs, rule);
      uint32_t node = of_items[item];
      while (node != kNone && is_last_to_arrive(&arrived[node], 1)) {
        costs[node] = treelet.cost_of_merge(tree.merges[node]);
        if (tree.merges[node].count >= size && treelet.restructure(node, size)) {
          for (uint32_t i = 0; i < treelet.merge_count(); ++i) {
            const uint32_t id = treelet.merge(i);
            for (const Subtree s : {tree.merges[id].left, tree.merges[id].right})
              (s.is_primitive() ? of_items : of_merges)[s.index()] = id;
          }
        }
        node = of_merges[node];
      }
    });
  }

 private:
  template <typename T>
  using Buffer = typename Exec::template Buffer<T>;

  Exec& exec_;
  TreeletInput tree_;
  LeafRule rule_;
  Buffer<float> costs_;
  Buffer<uint32_t> arrived_, merge_parents_, item_parents_;
};

/// Restructures the treelets of a tree on the processor.
void restructure(Bvh2& tree, uint32_t size, uint32_t rounds, const LeafRule& rule,
                 Progress& progress);

}  // namespace umbel::bvh
